"""Half width: how thick the visible wood is along a branch, from the branch matte."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

OCCLUDED = 0.15  # weight of a width whose edge is a leaf: the wood goes on behind it, so it is a lower bound


def edge_distance(wood: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Distance (H, W) px of the middle of each wood pixel to the wood's edge, half a pixel at the edge."""
    padded = np.pad(wood.astype(np.uint8), 1)  # the frame cuts the wood off
    distance = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
    return np.asarray(np.maximum(distance - 0.5, 0) * wood, dtype=np.float32)


def at_points(image: NDArray[Any], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (K,) of an image (H, W) in the pixels of points (K, 2); the nearest pixel's outside."""
    column, row = points.astype(np.int64).T
    height, width = image.shape
    return np.asarray(image[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)], np.float64)


def raw_half_width(distance: NDArray[np.float32], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest distance (K,) within a pixel of each point (K, 2); 0 where there is no wood."""
    steps = [np.array([dx, dy]) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    return np.asarray(np.max([at_points(distance, points + step) for step in steps], axis=0))


def side_weights(
    points: NDArray[np.float64], half: NDArray[np.float64], is_foliage: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Trust (K,) in half widths: low where, just outside the wood, a leaf begins on either side."""
    along = np.gradient(points, axis=0) if len(points) > 1 else np.array([[0.0, -1.0]])
    across = np.column_stack([-along[:, 1], along[:, 0]]) / np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    leafy = np.zeros(len(points))
    for sign in (-1, 1):
        for beyond in (1.5, 3.0):
            place = points + sign * across * (half + beyond)[:, None]
            column, row = np.clip(place.astype(np.int64), 0, np.array(is_foliage.shape[::-1]) - 1).T
            leafy += is_foliage[row, column] / 4
    return 1 - (1 - OCCLUDED) * leafy


def falling_fit(value: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """The non-increasing sequence (K,) nearest to values (K,) in weighted least squares (pool adjacent violators)."""
    means: list[float] = []
    weights: list[float] = []
    counts: list[int] = []
    for v, w in zip(value.tolist(), weight.tolist(), strict=True):
        means.append(v)
        weights.append(w)
        counts.append(1)
        while len(means) > 1 and means[-1] > means[-2]:
            total = weights[-1] + weights[-2]
            means[-2] = (means[-1] * weights[-1] + means[-2] * weights[-2]) / total
            weights[-2] = total
            counts[-2] += counts[-1]
            del means[-1], weights[-1], counts[-1]
    return np.repeat(means, counts)
