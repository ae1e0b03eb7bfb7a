"""Plane geometry of strokes: how far a line is from an outline, and what lies inside it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray


def distance_to_region(path: NDArray[np.float64], outline: NDArray[np.float64]) -> float:
    """Least distance between a polyline (K, 2) and the region inside an outline (M, 2); 0 where they meet, px."""
    if winding_number(path, outline).any():
        return 0.0
    start, end = outline, np.roll(outline, -1, axis=0)
    least = np.inf
    for a, b in pairwise(path):
        if (is_left(a, b, start) != is_left(a, b, end))[is_left(start, end, a) != is_left(start, end, b)].any():
            return 0.0
        ends = [
            distance_to_segment(a, start, end),
            distance_to_segment(b, start, end),
            distance_to_segment(outline, a, b),
        ]
        least = min(least, *(float(part.min()) for part in ends))
    return least


def is_left(a: NDArray[np.float64], b: NDArray[np.float64], point: NDArray[np.float64]) -> NDArray[np.bool_]:
    """On which side of the line from a to b a point lies; broadcasts over (..., 2)."""
    along, away = b - a, point - a
    return np.asarray(along[..., 0] * away[..., 1] - along[..., 1] * away[..., 0] > 0)


def distance_to_segment(
    point: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distance of points to segments from a to b; broadcasts over (..., 2)."""
    along, away = b - a, point - a
    length2 = (along**2).sum(axis=-1)
    t = np.clip((along * away).sum(axis=-1) / np.where(length2 > 0, length2, 1), 0, 1)
    return np.asarray(np.linalg.norm(away - t[..., None] * along, axis=-1))


def winding_number(points: NDArray[np.float64], outline: NDArray[np.float64]) -> NDArray[np.int64]:
    """How often a closed outline (M, 2) runs around each point (K,); 0 is outside."""
    start, end = outline, np.roll(outline, -1, axis=0)
    turns = np.empty(len(points), np.int64)
    for k, point in enumerate(points):
        is_upward = (start[:, 1] <= point[1]) & (end[:, 1] > point[1])
        is_downward = (end[:, 1] <= point[1]) & (start[:, 1] > point[1])
        left = is_left(start, end, point)
        turns[k] = (is_upward & left).sum() - (is_downward & ~left).sum()
    return turns
