"""Wood: which pixels of a tree are branches. Every segmenter shares this rule."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from forestgen.tree.colour_model import Mixture, component_distance, fit_mixture
from forestgen.tree.segment.min_cut import min_cut
from forestgen.tree.segment.region import Region
from forestgen.tree.segment.ribbon import CLEAR, Ribbon, follow_limb
from forestgen.tree.segment.smoothness import edge_costs
from forestgen.tree.strokes import Strokes

WOOD_COLOURS = 5  # Gaussians for wood (Tan et al. 2008, sec. 2)
LEAF_COLOURS = 8  # Gaussians for what else the crown shows
TOO_NEAR = 0.1  # Bhattacharyya distance at which a wood cluster counts as a leaf cluster and is dropped (sec. 2)
TRUNK_REACH, LIMB_REACH = 0.12, 0.06  # how far from its stroke a limb's edge is looked for, in crown sizes
UNDER_STROKE, UNDER_LEAVES, ELSEWHERE = 1.0, 0.0, -2.0  # log odds of wood: on a limb, a hidden one, off the limbs
ROUNDS = 2  # of refitting the leaf colours to what is not wood
CLIP = 6.0  # nats that one pixel's colour can say at most
SMOOTH, GUARD = 4.0, 8.0  # as lambda and guard of the foliage cut: limbs are larger than leaves
SPECK = 3e-5  # of the crown's area: smaller patches of wood off the stroked limbs are shade between leaves
ENOUGH = 200  # px of plain trunk below the crown that suffice to learn its colours from


@dataclass(frozen=True, eq=False)
class Limbs:
    """The limbs under the branch strokes of a region (h, w)."""

    ribbons: tuple[Ribbon, ...]
    cover: NDArray[np.float32]  # (h, w) share of each pixel under any ribbon, nothing below the root
    is_clear: NDArray[np.bool_]  # (h, w) pixels under a ribbon whose edges can be seen there


def follow_limbs(region: Region, strokes: Strokes) -> Limbs:
    """Find the edges of every stroked limb; the first stroke is the trunk and ends at the root's row."""
    size = (region.depth.shape[1], region.depth.shape[0])
    ribbons = []
    cover, clear = np.zeros((2, *region.depth.shape), np.float32)
    for index, path in enumerate(strokes.branches):
        reach = max(8.0, (LIMB_REACH if index else TRUNK_REACH) * region.size_px)
        ribbons.append(follow_limb(region.rgb, region.local(path), reach))
        np.maximum(cover, ribbons[-1].coverage(size), out=cover)
        np.maximum(clear, ribbons[-1].coverage(size, ribbons[-1].clarity > CLEAR / 2), out=clear)
    root_row = int(np.ceil(region.local(strokes.root)[1]))
    cover[max(root_row, 0) :] = 0
    return Limbs(tuple(ribbons), cover, (clear >= 0.5) & (cover >= 0.5))


def find_wood(
    region: Region,
    is_tree: NDArray[np.bool_],
    log_background: NDArray[np.float32],
    limbs: Limbs,
    *,
    rng: np.random.Generator,
) -> NDArray[np.bool_]:
    """Wood pixels (h, w): outside the crown the ribbons, inside it what has the wood's colours.

    `is_tree` says what is leaf or wood inside the crown, `log_background` (h, w) how likely each
    colour is as background. Wood may also be found where `is_tree` missed it.
    """
    on_limb = limbs.cover >= 0.5
    outside = on_limb & ~region.is_inside
    wood, leaf = _colours(region, is_tree, limbs, rng)
    if wood is None:
        return outside
    inside = region.is_inside
    says = np.full(inside.shape, -CLIP, np.float32)
    rgb = region.rgb[inside]
    other = log_background[inside] if leaf is None else np.logaddexp(leaf.log_density(rgb), log_background[inside])
    prior = np.where(limbs.is_clear[inside], UNDER_STROKE, np.where(on_limb[inside], UNDER_LEAVES, ELSEWHERE))
    says[inside] = np.clip(wood.log_density(rgb) - other + prior, -CLIP, CLIP)
    found = min_cut(np.maximum(-says, 0), np.maximum(says, 0), *edge_costs(region.rgb, SMOOTH, GUARD))
    return outside | (_without_specks(found, on_limb, region) & inside)


def _colours(
    region: Region, is_tree: NDArray[np.bool_], limbs: Limbs, rng: np.random.Generator
) -> tuple[Mixture | None, Mixture | None]:
    """Colours of the wood and of the leaves; None where there are none to learn or tell apart."""
    plain = limbs.cover > 0.9
    below = plain & ~region.is_inside
    sample = below if below.sum() >= ENOUGH else plain
    if not sample.any():
        return None, None
    wood = fit_mixture(region.rgb[plain], WOOD_COLOURS, rng=rng, weight=np.where(sample[plain], 1.0, 0.3))
    crown = region.rgb[is_tree & region.is_inside & (limbs.cover < 0.1)]
    if len(crown) < 50:
        return wood, None
    crown = crown[rng.permutation(len(crown))[:20_000]]
    leaf = fit_mixture(crown, LEAF_COLOURS, rng=rng)
    for _ in range(ROUNDS):
        is_leaf = expit(leaf.log_density(crown) - wood.log_density(crown) - ELSEWHERE)
        leaf = fit_mixture(crown, LEAF_COLOURS, rng=rng, weight=is_leaf, start=leaf)
    distinct = component_distance(wood, leaf).min(axis=1) > TOO_NEAR
    return (wood.subset(distinct) if distinct.any() else None), leaf


def _without_specks(is_wood: NDArray[np.bool_], on_limb: NDArray[np.bool_], region: Region) -> NDArray[np.bool_]:
    """The mask without patches that are tiny and touch no stroked limb."""
    _, label, stats, _ = cv2.connectedComponentsWithStats(is_wood.astype(np.uint8), connectivity=8)
    keep = stats[:, cv2.CC_STAT_AREA] >= max(4, SPECK * region.size_px**2)
    keep[np.unique(label[on_limb & is_wood])] = True
    keep[0] = False
    return np.asarray(keep[label])


def share_out(
    alpha: NDArray[np.float32], is_leaf: NDArray[np.bool_], is_wood: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Split the tree's alpha (h, w) into leaf and wood; the soft rim goes to what it is the rim of.

    A pixel belongs to one of them: split evenly, both would fall below one half and leave a seam.
    """
    near_leaf, near_wood = (cv2.blur(mask.astype(np.float32), (5, 5)) for mask in (is_leaf, is_wood))
    to_wood = is_wood | (~is_leaf & (near_wood > near_leaf))
    return np.where(to_wood, 0, alpha).astype(np.float32), np.where(to_wood, alpha, 0).astype(np.float32)
