"""Leaves aimed at foliage that no leaf covers yet, from the twigs within reach of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.tree.foliage_fit import Target
from forestgen.tree.foliage_poses import normals_across
from forestgen.tree.foliage_twigs import YoungWood

SEED_CELL = 0.35  # side of the cells that send one leaf each, in lengths of a leaf
LEAST_OPEN = 3  # px of a cell that must be open
NEAREST = 32  # twigs that a pixel may choose from
CLEAR = 0.15  # lengths of a leaf by which a leaf's middle passes before wood that it is to hide
TILT = 0.5  # radians by which such a leaf leaves the picture plane, standard deviation


@dataclass(frozen=True, eq=False)
class Aim:
    """Leaves that reach for open foliage. L leaves."""

    foot: NDArray[np.float64]  # (L, 3) m, on the bark
    axis: NDArray[np.float64]  # (L, 3) unit
    normal: NDArray[np.float64]  # (L, 3) unit
    way: NDArray[np.float64]  # (L,) m along the axis from the foot to the foliage that is open

    def take(self, pick: NDArray[np.bool_]) -> Aim:
        return Aim(self.foot[pick], self.axis[pick], self.normal[pick], self.way[pick])


@dataclass(frozen=True, eq=False)
class Feet:
    """Points along the young wood from which leaves are aimed, as a view sees them. N points."""

    foot: NDArray[np.float64]  # (N, 3) m
    radius: NDArray[np.float64]  # (N,) m, of the wood there
    flat: NDArray[np.float64]  # (N, 2) px
    depth: NDArray[np.float64]  # (N,) m towards the camera
    nearest: cKDTree  # of them in the picture

    @staticmethod
    def of(wood: YoungWood, target: Target, length: float) -> Feet:
        """Points a quarter of a leaf's `length` apart, metres."""
        foot, radius = spread_points(wood, 0.25 * length)
        flat = target.view.camera.project(foot)
        return Feet(foot, radius, flat, target.view.camera.depth(foot), cKDTree(flat))


def aim_at_open(
    target: Target, feet: Feet, length: float, reach: float, *, wood_only: bool = False, rng: np.random.Generator
) -> Aim:
    """Aim leaves, from twigs up to `reach` metres away in the picture, at open foliage: one for each small cell.

    With `wood_only` they are aimed at wood that the photo does not show, however little of it is bare.
    """
    camera = target.view.camera
    px = length * camera.px_per_metre
    is_open = target.open & target.is_grown if wood_only else target.open
    seed = open_seeds(is_open, max(1.0, SEED_CELL * px), 1 if wood_only else LEAST_OPEN, rng=rng)
    foot, k = feet.foot, min(NEAREST, len(feet.foot))
    far, near = feet.nearest.query(seed, k=k, distance_upper_bound=reach * camera.px_per_metre)
    far, near = far.reshape(len(seed), k), near.reshape(len(seed), k)
    count = np.isfinite(far).sum(axis=1)
    reached = count > 0
    barrier = target.wood_depth[seed[:, 1].astype(np.int64), seed[:, 0].astype(np.int64)].astype(float)
    behind = barrier[:, None] - feet.depth[np.minimum(near, len(foot) - 1)]  # -inf where no wood is in the way
    wish = rng.random(near.shape) + np.clip(behind / reach, 0, 3)  # twigs that stand before that wood, or nearly
    chosen = near[np.arange(len(seed)), np.where(np.isfinite(far), wish, np.inf).argmin(axis=1)][reached]
    seed, barrier = seed[reached], barrier[reached]

    flat_way = (seed - feet.flat[chosen]) / camera.px_per_metre * [1.0, -1.0]  # m, in the picture
    tilt = rng.normal(0, TILT, len(seed)).clip(-1.2, 1.2)
    over = barrier + CLEAR * length - feet.depth[chosen]
    needed = np.arctan2(np.maximum(over, 0), np.linalg.norm(flat_way, axis=1) + 1e-9)
    tilt = np.where(over > 0, np.maximum(tilt, np.minimum(needed, 1.3)), tilt)
    ahead = flat_way + 1e-9 * rng.normal(size=flat_way.shape)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    right, up, toward = camera.axes
    axis = np.cos(tilt)[:, None] * (ahead[:, :1] * right + ahead[:, 1:] * up) + np.sin(tilt)[:, None] * toward
    light = toward + np.array([0.0, 0.6, 0.0])
    normal = normals_across(axis, light + rng.normal(0, 0.4, axis.shape))
    way = np.linalg.norm(flat_way, axis=1) / np.cos(tilt)
    return Aim(foot[chosen] + axis * feet.radius[chosen][:, None] * 0.9, axis, normal, way)


def open_seeds(
    is_open: NDArray[np.bool_], cell: float, least: int = LEAST_OPEN, *, rng: np.random.Generator
) -> NDArray[np.float64]:
    """One open pixel (S, 2) xy of each square cell that has `least` of them."""
    row, column = np.nonzero(is_open)
    if not len(row):
        return np.zeros((0, 2))
    key = (row / cell).astype(np.int64) * (is_open.shape[1] + 1) + (column / cell).astype(np.int64)
    order = np.lexsort((rng.random(len(key)), key))
    _, first, count = np.unique(key[order], return_index=True, return_counts=True)
    pick = order[first[count >= least]]
    return np.column_stack([column[pick] + 0.5, row[pick] + 0.5])


def spread_points(wood: YoungWood, step: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (N, 3) about `step` metres apart along the young wood, and its radius there (N,)."""
    n = np.maximum(1, np.ceil(wood.length / step)).astype(np.int64)
    edge = np.repeat(np.arange(len(wood)), n)
    t = (np.arange(len(edge)) - np.repeat(np.cumsum(n) - n, n) + 0.5) / n[edge]
    return wood.start[edge] + t[:, None] * (wood.end - wood.start)[edge], wood.radius[edge]
