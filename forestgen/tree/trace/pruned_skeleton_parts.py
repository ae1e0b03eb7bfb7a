"""Contour parts: which ends of a thinned mask stay, by the parts of the outline that made them.

Bai et al. 2007: the outline is cut into parts at the convex vertices that curve evolution leaves. A
point of the skeleton has a largest disc that touches the outline; it stays where the touched points
lie on different parts. Here whole ends go, from their tips inward, so that all stays connected.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.tree.trace.curve_evolution import Contours
from forestgen.tree.trace.half_width import at_points
from forestgen.tree.trace.wood_network import WoodNetwork, cut_at_junctions

TOUCH = 1.5  # px: a line of pixels lies this near to the true middle; what is as much farther is touched too
ROUNDS = 6  # an end may stand on an end that goes


def convex(contours: Contours, kept: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those of the vertices (M,) at which the polygon between them is convex: only there branches end."""
    return kept[contours.turns(kept) > 0]


def parts_of(contours: Contours, vertices: NDArray[np.int64]) -> NDArray[np.int64]:
    """The part (N,) of the outlines to which each point belongs when they are cut at `vertices` (V,).

    A polygon with one vertex is cut on its far side too: the branch that ends there has two sides.
    """
    size = np.bincount(contours.ring)
    first = np.cumsum(size) - size
    alone = vertices[(np.bincount(contours.ring[vertices], minlength=len(size)) == 1)[contours.ring[vertices]]]
    start, many = first[contours.ring[alone]], size[contours.ring[alone]]
    cut = np.zeros(len(contours), np.int64)
    cut[np.concatenate([vertices, start + (alone - start + many // 2) % many])] = 1
    part = np.cumsum(cut) + contours.ring  # another at every cut and on every polygon
    before_cut = part == (part[first] - cut[first])[contours.ring]
    return np.where(before_cut, part[first + size - 1][contours.ring], part)  # the last goes on over the seam


def pruned(thin: NDArray[np.bool_], contours: Contours, part: NDArray[np.int64]) -> NDArray[np.bool_]:
    """A thinned mask (H, W) without the ends that one part (N,) of the outline made alone."""
    thin, touching = thin.copy(), cKDTree(contours.xy)
    for _ in range(ROUNDS):
        ends = free_ends(cut_at_junctions(thin))
        if not ends:
            break
        alone = made_alone(np.concatenate(ends), touching, part)
        bounds = np.cumsum([len(points) for points in ends])[:-1]
        gone = [points[: _first_false(one)] for points, one in zip(ends, np.split(alone, bounds), strict=True)]
        column, row = np.concatenate(gone).astype(int).T
        if not len(row):
            break
        thin[row, column] = False
    return thin


def free_ends(network: WoodNetwork) -> list[NDArray[np.float64]]:
    """The pieces of a network that end free on one side, each from its free end on, (K, 2) px."""
    found = []
    for points, (start, end) in zip(network.points, network.ends.tolist(), strict=True):
        if (start < 0) != (end < 0):
            found.append(points if start < 0 else points[::-1])
    return found


def made_alone(points: NDArray[np.float64], outline: cKDTree, part: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether the largest discs about points (K, 2) px touch one part (N,) of the outline only, (K,)."""
    away, _ = outline.query(points)
    touched = outline.query_ball_point(points, away + TOUCH)
    many = np.array([len(one) for one in touched])
    start = np.cumsum(many) - many
    label = part[np.concatenate([np.asarray(one, np.int64) for one in touched])]
    return np.asarray(np.minimum.reduceat(label, start) == np.maximum.reduceat(label, start))


def _first_false(values: NDArray[np.bool_]) -> int:
    return len(values) if values.all() else int(np.argmin(values))


def carried_on(thin: NDArray[np.bool_], wood: NDArray[np.bool_], distance: NDArray[np.float32]) -> NDArray[np.bool_]:
    """The thinned mask (H, W) with its free ends carried straight on to the wood's edge: thinning shortens them.

    `distance` (H, W) of each pixel of the wood to the wood's edge, px.
    """
    thin = thin.copy()
    height, width = wood.shape
    ends = free_ends(cut_at_junctions(thin))
    for points, half in zip(ends, at_points(distance, np.array([p[0] for p in ends]).reshape(-1, 2)), strict=True):
        back = points[min(len(points) - 1, int(2 * half) + 4)]
        heading = points[0] - back
        if not heading.any():
            continue
        steps = np.arange(1, int(2 * half) + 3)[:, None]
        column, row = (points[0] + steps * heading / np.hypot(*heading)).astype(int).T
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        inside &= wood[row.clip(0, height - 1), column.clip(0, width - 1)]
        n = _first_false(inside)
        thin[row[:n], column[:n]] = True
    return thin
