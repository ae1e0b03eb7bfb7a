"""Leaves aimed at foliage that no leaf covers yet, from the twigs within reach of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.tree.foliage_fit import Target
from forestgen.tree.foliage_poses import normals_across, unit
from forestgen.tree.foliage_twigs import YoungWood

SEED_CELL = 0.35  # side of the cells that send one leaf each, in lengths of a leaf
LEAST_OPEN = 3  # px of a cell that must be open
AIM = 0.6  # which place along a leaf is laid on the open pixel
NEAREST = 16  # twigs that a pixel may choose from
TILT = 0.5  # radians by which such a leaf leaves the picture plane, standard deviation
SMALLEST, LARGEST = 0.5, 1.25  # of the usual length


def aim_at_open(
    target: Target, wood: YoungWood, length: float, *, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Feet (L, 3), axes (L, 3), normals (L, 3) and lengths (L,) of leaves that reach for open foliage."""
    camera = target.view.camera
    px = length * camera.px_per_metre
    seed = open_seeds(target.open, max(1.0, SEED_CELL * px), rng=rng)
    foot, radius = spread_points(wood, 0.25 * length)
    flat = camera.project(foot)
    far, near = cKDTree(flat).query(seed, k=min(NEAREST, len(foot)), distance_upper_bound=AIM * LARGEST * px)
    far, near = far.reshape(len(seed), -1), near.reshape(len(seed), -1)
    count = np.isfinite(far).sum(axis=1)
    reached = count > 0
    pick = np.minimum((rng.random(len(seed)) * count).astype(np.int64), np.maximum(count - 1, 0))
    chosen = near[np.arange(len(seed)), pick][reached]
    seed = seed[reached]

    way = (seed - flat[chosen]) / camera.px_per_metre  # m, in the picture
    tilt = rng.normal(0, TILT, len(seed))
    size = np.clip(np.linalg.norm(way, axis=1) / np.cos(tilt) / AIM, SMALLEST * length, LARGEST * length)
    plane = unit(np.column_stack([way[:, 0], -way[:, 1]]) + 1e-9 * rng.normal(size=(len(seed), 2)))
    right, up, toward = camera.axes
    axis = np.cos(tilt)[:, None] * (plane[:, :1] * right + plane[:, 1:] * up) + np.sin(tilt)[:, None] * toward
    normal = normals_across(axis, toward + [0.0, 0.6, 0.0] + rng.normal(0, 0.4, axis.shape))
    outward = unit(axis)
    return foot[chosen] + outward * radius[chosen][:, None] * 0.9, axis, normal, size


def open_seeds(is_open: NDArray[np.bool_], cell: float, *, rng: np.random.Generator) -> NDArray[np.float64]:
    """One open pixel (S, 2) xy of each square cell that has some."""
    row, column = np.nonzero(is_open)
    if not len(row):
        return np.zeros((0, 2))
    key = (row / cell).astype(np.int64) * (is_open.shape[1] + 1) + (column / cell).astype(np.int64)
    order = np.lexsort((rng.random(len(key)), key))
    _, first, count = np.unique(key[order], return_index=True, return_counts=True)
    pick = order[first[count >= LEAST_OPEN]]
    return np.column_stack([column[pick] + 0.5, row[pick] + 0.5])


def spread_points(wood: YoungWood, step: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (N, 3) about `step` metres apart along the young wood, and its radius there (N,)."""
    n = np.maximum(1, np.ceil(wood.length / step)).astype(np.int64)
    edge = np.repeat(np.arange(len(wood)), n)
    t = (np.arange(len(edge)) - np.repeat(np.cumsum(n) - n, n) + 0.5) / n[edge]
    return wood.start[edge] + t[:, None] * (wood.end - wood.start)[edge], wood.radius[edge]
