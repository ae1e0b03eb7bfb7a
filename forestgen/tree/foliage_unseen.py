"""Colours for the leaves that no photo shows: the crown's own, moved about in clumps, lighter where light falls.

A leaf behind others that took the colour of its projected place would repeat that place all along
the line of sight: from the side a crown would be striped.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

SEEN = 0.15  # share of a leaf that must be in front for it to be one that a photo shows
WAVES = 8  # that are added up to move places about
LONGEST, SHORTEST = 0.35, 0.09  # their lengths, as shares of the crown's size: as clumps and limbs are
DRIFT = 0.09  # standard deviation of the way that a place is moved, along each axis, as a share of the crown's size
CELL = 0.04  # of the crown's size: the cells in which leaves are counted that stand in the light's way
CONTRAST = 0.9  # between the darkest and the lightest hidden leaves, over the photo's own spread of light


def seen_share(pixel: NDArray[np.int64], depth: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """How much of each leaf (L,) is in front in a picture of `size` pixels.

    `pixel` (L, S) are the pixels that leaves fall on, -1 where wood hides them; `depth` (L,) grows
    towards the camera.
    """
    order = np.argsort(depth, kind="stable")
    leaf = np.repeat(order, pixel.shape[1])
    flat = pixel[order].ravel()
    there = flat >= 0
    front = np.full(size, -1)
    front[flat[there]] = leaf[there]  # of equal indices the last counts: the nearest leaf
    return np.asarray(((pixel >= 0) & (front[pixel] == np.arange(len(pixel))[:, None])).mean(axis=1))


def drift(points: NDArray[np.float64], extent: float, *, rng: np.random.Generator) -> NDArray[np.float64]:
    """Ways (N, 3) in metres by which points (N, 3) of a crown `extent` metres large are moved: alike within a clump."""
    length = extent * np.exp(rng.uniform(np.log(SHORTEST), np.log(LONGEST), (3, WAVES)))
    heading = rng.normal(size=(3, WAVES, 3))
    heading *= (2 * np.pi / length / np.linalg.norm(heading, axis=2))[..., None]
    phase = rng.uniform(0, 2 * np.pi, (3, WAVES))
    ways = [np.sin(points @ h.T + p).sum(axis=1) for h, p in zip(heading, phase, strict=True)]
    return np.asarray(np.stack(ways, axis=1) * DRIFT * extent / np.sqrt(WAVES / 2))


def light(points: NDArray[np.float64], area: NDArray[np.float64], extent: float) -> NDArray[np.float64]:
    """How lit each leaf (N,) is among all leaves, by rank from -1 (deep inside and below) to 1 (outside, above).

    Leaves (N, 3) of some `area` (N,) stand in each other's light, which falls from above and half as
    strongly from each side.
    """
    index = np.floor((points - points.min(axis=0)) / (CELL * extent)).astype(np.int64)
    grid = np.zeros(index.max(axis=0) + 1)
    np.add.at(grid, tuple(index.T), area)
    grid = gaussian_filter(grid, 1.0, mode="constant")
    before = [(1.0, np.cumsum(grid[:, ::-1], axis=1)[:, ::-1] - grid)]
    for axis in (0, 2):
        before.append((0.5, np.cumsum(grid, axis=axis) - grid))
        before.append((0.5, np.flip(np.cumsum(np.flip(grid, axis), axis=axis), axis) - grid))
    usual = max(float(np.median(before[0][1][tuple(index.T)])), 1e-12)
    falls = sum(weight * np.exp(-shade / usual) for weight, shade in before)
    there = np.asarray(falls)[tuple(index.T)]
    rank = np.empty(len(there))
    rank[np.argsort(there, kind="stable")] = np.arange(len(there))
    return np.asarray(2 * (rank + 0.5) / len(there) - 1)
