"""Thinned-out wood: fewer, thicker twigs that cover as much as all did, from the same skeleton."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.limbs import (
    Limbs,
    limbs_along,
    merge_coincident,
    thickest_child,
    tree_size,
    without_hairpins,
)
from forestgen.tree.lod_order import bit_reversed, morton
from forestgen.tree.lod_outline import outline_weight
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Bark, Mesh
from forestgen.tree.skeleton import Skeleton

WHOLE_CURVE = 7.0  # of the space-filling curve's levels: twigs next to each other stay next to each other
UNDER_PARENT = 0.95  # radius of a thickened twig at its base, over its parent's, at most


def thinned_out(skeleton: Skeleton, thinnest: float, *, is_bare: bool) -> Skeleton:
    """The skeleton without some of the limbs that are thinner than `thinnest` metres on average.

    As stochastic simplification does with leaves (see `lod_leaves`): of limbs half as thick as that every
    second stays and is drawn twice as thick, so that the wood covers as much of the sky as before. Which ones
    stay is fixed and even in space; a limb stays as long as one stands on it; those at a bare crown's outline,
    which no leaf draws, stay longer. What a smaller `thinnest` drops, a greater one drops too.

    Raises:
        ValueError: a radius is NaN.
    """
    merged = merge_coincident(skeleton)
    if len(merged) == 1 or thinnest <= 0:
        return merged
    limbs = limbs_along(merged, without_hairpins(merged, thickest_child(merged)))
    length, area = limb_sizes(limbs, merged)
    end = merged.position[limbs.node[limbs.first[1:] - 1]]
    share = np.minimum(1.0, area / np.maximum(length, 1e-12) / thinnest * (outline_weight(end) if is_bare else 1.0))
    share[0] = 1.0
    lot = np.empty(len(limbs))
    lot[np.argsort(morton(end, WHOLE_CURVE), kind="stable")] = bit_reversed(len(limbs))
    keeps = lot < share
    for limb in np.flatnonzero(limbs.parent >= 0)[::-1]:
        keeps[limbs.parent[limb]] |= keeps[limb]
    return _rebuilt(merged, limbs, keeps, thickening(area, share, keeps))


def swept(skeleton: Skeleton, bark: Bark, sweep: GeneralisedCylinders, finest: GeneralisedCylinders) -> Mesh:
    """The wood's mesh by `sweep`, as wide to the eye as `finest` would make it with its more numerous sides.

    A polygon of n sides in a circle of radius r is n sin(pi/n) 2 r / pi wide on average over its turns.
    """
    merged = merge_coincident(skeleton)
    size = tree_size(merged.position)
    thick = np.maximum(merged.radius, 1e-9)
    wide = [polygon_width(one.flats(thick, max(size, 1e-3))) for one in (finest, sweep)]
    return sweep(Skeleton(merged.position, merged.parent, merged.radius * wide[0] / wide[1]), bark)


def polygon_width(flats: NDArray[np.int64]) -> NDArray[np.float64]:
    """Mean width of regular polygons of so many sides (N,) over that of their circles."""
    return np.asarray(flats * np.sin(np.pi / flats) / np.pi)


def limb_sizes(limbs: Limbs, skeleton: Skeleton) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Length (L,) m of limbs and the area (L,) m2 that each covers, seen from its side."""
    position, radius = skeleton.position[limbs.node], skeleton.radius[limbs.node]
    radius[limbs.first[1:-1]] = radius[limbs.first[1:-1] + 1]  # a side limb starts as thick as its own first node
    step = np.zeros(len(limbs.node))
    step[:-1] = np.linalg.norm(np.diff(position, axis=0), axis=1)
    step[~limbs.has_next] = 0
    wide = radius + np.append(radius[1:], 0)
    return np.add.reduceat(step, limbs.first[:-1]), np.add.reduceat(step * wide, limbs.first[:-1])


def thickening(area: NDArray[np.float64], share: NDArray[np.float64], keeps: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Factor (L,) on the radii of limbs kept, so that the area (L,) of all is kept: c / share, at least 1."""
    lost = float(area[~keeps].sum())
    thin = keeps & (share < 1)
    factor = np.ones(len(area))
    if lost <= 0 or not thin.any():
        return factor
    low, high = 0.0, 1.0 + (area[thin].sum() + lost) / (area[thin] / share[thin]).sum()
    for _ in range(50):
        middle = (low + high) / 2
        gained = (area[thin] * (np.maximum(1.0, middle / share[thin]) - 1)).sum()
        low, high = (middle, high) if gained < lost else (low, middle)
    factor[thin] = np.maximum(1.0, high / share[thin])
    return factor


def _rebuilt(skeleton: Skeleton, limbs: Limbs, keeps: NDArray[np.bool_], factor: NDArray[np.float64]) -> Skeleton:
    """The limbs kept, thickened, none thicker than what it stands on."""
    own = np.ones(len(limbs.node), bool)
    own[limbs.first[1:-1]] = False  # the base of a side limb is its parent's node
    limb_of = np.empty(len(skeleton), np.int64)
    limb_of[limbs.node[own]] = limbs.limb[own]
    radius = skeleton.radius.copy()
    for limb in np.flatnonzero(keeps & (limbs.parent >= 0)):  # parents come first
        nodes = limbs.node[limbs.first[limb] + 1 : limbs.first[limb + 1]]
        most = UNDER_PARENT * radius[limbs.node[limbs.first[limb]]] / max(radius[nodes[0]], 1e-12)
        radius[nodes] *= max(1.0, min(factor[limb], most))
    stays = keeps[limb_of]
    index = np.cumsum(stays) - 1
    parent = index[skeleton.parent[stays]]
    parent[0] = -1
    return Skeleton(skeleton.position[stays], parent, radius[stays])
