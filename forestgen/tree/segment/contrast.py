"""Leaf or background by contrast: what is in the crown and not in the ring around it is tree.

Tan et al. 2008 take the four most green or red clusters for leaves, which fails for white blossom,
autumn yellow, frost or a grey photo. Here the background is learnt where it is known, outside the
crown, as a model that follows the place; tree are the colours that are commoner inside than that
model lets expect. Colours that a neighbour shares stay the tree's as far as the crown has more of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from forestgen.errors import StageError
from forestgen.tree.colour_model import Mixture, fit_mixture
from forestgen.tree.segment.background_field import BackgroundField, spread_background
from forestgen.tree.segment.region import Region

FITTED_ON = 150_000  # pixels: the models are fitted on every n-th pixel of larger windows
BACKGROUND_COLOURS = 10  # Gaussians for what is around the tree: sky, cloud, hill, ground, walls
ROUNDS = 3  # of refitting both models to what they found
SHARP, LEAST = 3.0, 1e-6  # how sharply colours commoner in the crown than around it are chosen for a start
AIRIEST = -2.0  # log odds: at most so much the share of sky in an airy crown speaks against a pixel
SURE_DEPTH = 0.03  # depth inside the outline, as a share of the crown's size, from where tree is as likely as e to 1
GAP, OPEN = 3, 0.5  # of the fitted-on pixels: a gap so wide and so certain counts as open background
CLIP = 8.0  # nats: what one pixel's colour can say at most, so that a stray colour does not outvote its neighbours
SEEN, DIFFERENT = 0.02, 2.5  # share of the crown that must differ by so many nats; pure noise and sky reach 2.3
FAINT = -50.0  # nats, for places that are out of the question


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the colours say of each pixel of a region (h, w), in nats."""

    log_ratio: NDArray[np.float32]  # tree against background; FAINT outside the widened crown
    log_background: NDArray[np.float32]  # density of the background's colours


def contrast_inside_and_ring(region: Region, components: int, *, rng: np.random.Generator) -> Evidence:
    """Compare each colour in the crown with the ring's colours near it.

    Raises:
        StageError: the crown fills the photo so that nothing is left to compare with, or does not differ from it.
    """
    prior = outline_prior(region)
    tree, background, odds = _learn(region, prior, components, rng)
    log_background = background.log_density(region.rgb)
    log_ratio = np.full(region.depth.shape, FAINT, np.float32)
    inside = region.is_inside
    says = tree.log_density(region.rgb[inside]) - log_background[inside]
    if np.quantile(says, 1 - SEEN) < DIFFERENT:
        raise StageError("nothing in the crown differs from what is around it: is the outline on the tree?")
    log_ratio[inside] = np.clip(says + prior[inside] + odds, -CLIP, CLIP)
    return Evidence(log_ratio, log_background)


def _learn(
    region: Region, prior: NDArray[np.float32], components: int, rng: np.random.Generator
) -> tuple[Mixture, BackgroundField, float]:
    """The colours of tree and of background, and the log odds of tree in this crown.

    Begins with the colours that are commoner in the crown than around it; then, in turns, the
    background learns from the gaps in the crown, and the tree from what the background leaves.
    """
    stride = max(1, round((region.depth.size / FITTED_ON) ** 0.5))
    part = (slice(None, None, stride), slice(None, None, stride))
    rgb, is_ring, is_inside = region.rgb[part], region.is_ring[part], region.is_inside[part]
    if is_ring.sum() < 50:
        raise StageError("no background is left around 'crown': draw a background stroke, or take a wider photo")
    crown, place, gap = rgb[is_inside], prior[part][is_inside], is_inside & ~is_ring
    colours = fit_mixture(rgb[is_ring], BACKGROUND_COLOURS, rng=rng)
    background = spread_background(rgb, is_ring.astype(np.float32), is_ring, is_ring, colours)
    known = background.log_density(rgb)[is_inside]
    is_tree = expit(SHARP * (fit_mixture(crown, components, rng=rng).log_density(crown) - known))
    tree = fit_mixture(crown, components, rng=rng, weight=is_tree + LEAST)
    for _ in range(ROUNDS):
        is_tree = expit(tree.log_density(crown) - known + place + odds_of_share(is_tree))
        certainty = is_ring.astype(np.float32)
        certainty[gap] = ((1 - is_tree) ** 2)[~is_ring[is_inside]]
        is_open = is_ring | (cv2.erode(certainty, np.ones((GAP, GAP), np.uint8)) > OPEN)
        background = spread_background(rgb, certainty, is_ring, is_open, colours)
        known = background.log_density(rgb)[is_inside]
        tree = fit_mixture(crown, components, rng=rng, weight=is_tree + LEAST, start=tree)
    return tree, background, odds_of_share(is_tree)


def odds_of_share(is_tree: NDArray[np.floating]) -> float:
    """Log odds of a crown pixel from the share of the crown that is tree so far: an airy crown is mostly sky."""
    share = float(np.clip(is_tree.mean(), 1e-3, 1 - 1e-3))
    return float(np.clip(np.log(share / (1 - share)), AIRIEST, 0))


def outline_prior(region: Region) -> NDArray[np.float32]:
    """Log odds (h, w) of tree from the place alone: 1 well inside the outline, 0 on it, -2 well outside."""
    return np.asarray(np.clip(region.depth / np.float32(SURE_DEPTH * region.size_px), -2, 1))
