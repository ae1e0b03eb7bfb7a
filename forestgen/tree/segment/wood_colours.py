"""Wood colours: what colours a tree's wood has and what its leaves have, where leaves hide much of the wood."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from forestgen.tree.colour_model import ENOUGH_SAMPLES, Mixture, component_distance, fit_mixture
from forestgen.tree.segment.region import Region

WOOD_COLOURS = 5  # Gaussians for wood (Tan et al. 2008, sec. 2)
LEAF_COLOURS = 8  # Gaussians for what else the crown shows
TOO_NEAR = 0.1  # Bhattacharyya distance at which a wood cluster counts as a leaf cluster and is dropped (sec. 2)
AMONG_LEAVES = 0.3  # what pixels of a stroked limb in the crown count for the wood's colours: leaves hide it
UNDER, OFF = 0.9, 0.1  # cover by the strokes' ribbons from where a pixel is under them, and up to where it is off them
ENOUGH = 200  # px of plain trunk below the crown that suffice to learn its colours from
FEW = 50  # px of crown off the limbs: with fewer nothing is known of the leaves
ROUNDS = 2  # of refitting to what is not the other
ELSEWHERE = -1.0  # log odds of wood off the stroked limbs


def colours_under_strokes(region: Region, cover: NDArray[np.float32], rng: np.random.Generator) -> Mixture | None:
    """Colours under the ribbons (h, w), None where they cover nothing.

    Those of the plain trunk below the crown count more than those among leaves.
    """
    plain = cover > UNDER
    if not plain.any():
        return None
    below = ~region.is_inside[plain]
    weight = np.where(below | (below.sum() < ENOUGH), 1.0, AMONG_LEAVES)
    return fit_mixture(region.rgb[plain], WOOD_COLOURS, rng=rng, weight=weight)


def leaf_colours(
    region: Region, is_tree: NDArray[np.bool_], cover: NDArray[np.float32], wood: Mixture, rng: np.random.Generator
) -> Mixture | None:
    """Colours of the crown's tree pixels off the stroked limbs, as far as they are not the wood's; None if too few."""
    crown = _off_limbs(region, is_tree, cover, rng)
    if crown is None:
        return None
    leaf = fit_mixture(crown, LEAF_COLOURS, rng=rng)
    for _ in range(ROUNDS):
        is_leaf = expit(leaf.log_density(crown) - wood.log_density(crown) - ELSEWHERE)
        leaf = fit_mixture(crown, LEAF_COLOURS, rng=rng, weight=is_leaf, start=leaf)
    return leaf


def bark_colours(
    region: Region, is_tree: NDArray[np.bool_], cover: NDArray[np.float32], wood: Mixture, rng: np.random.Generator
) -> Mixture:
    """Colours of the wood that shows under the strokes, without those of the leaves that hide it there.

    Begins with the plain trunk below the crown; under the strokes in the crown counts what looks
    more like it than like the crown off the limbs. `wood`, the colours of all that lies under the
    strokes, where too little plain trunk shows.
    """
    under = cover > UNDER
    below, within = region.rgb[under & ~region.is_inside], region.rgb[under & region.is_inside]
    crown = _off_limbs(region, is_tree, cover, rng)
    if crown is None or len(below) < ENOUGH or not len(within):
        return wood
    leaf = fit_mixture(crown, LEAF_COLOURS, rng=rng)
    below, among = _some(below, rng), _some(within, rng)
    both, share = np.concatenate([below, among]), len(within) / len(among)
    bark = fit_mixture(below, WOOD_COLOURS, rng=rng)
    for _ in range(ROUNDS):
        is_bark = expit(bark.log_density(among) - leaf.log_density(among))
        weight = np.concatenate([np.ones(len(below)), share * is_bark])
        bark = fit_mixture(both, WOOD_COLOURS, rng=rng, weight=weight)
    return bark


def distinct_colours(wood: Mixture | None, leaf: Mixture | None) -> Mixture | None:
    """The wood's mixture without the clusters too near a leaf's (Tan et al. 2008, sec. 2); None if none is left."""
    if wood is None or leaf is None:
        return wood
    is_distinct = component_distance(wood, leaf).min(axis=1) > TOO_NEAR
    return wood.subset(is_distinct) if is_distinct.any() else None


def _off_limbs(
    region: Region, is_tree: NDArray[np.bool_], cover: NDArray[np.float32], rng: np.random.Generator
) -> NDArray[np.float32] | None:
    """Colours (N, 3) of the crown's tree pixels off the stroked limbs; None if too few."""
    crown = region.rgb[is_tree & region.is_inside & (cover < OFF)]
    return None if len(crown) < FEW else crown[rng.integers(len(crown), size=min(len(crown), ENOUGH_SAMPLES))]


def _some(colours: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """As many of the colours (N, 3) as a mixture needs."""
    return colours if len(colours) <= ENOUGH_SAMPLES else colours[rng.integers(len(colours), size=ENOUGH_SAMPLES)]
