"""Painted foliage and painted holes (Neubert et al. 2007, sec. 9): the user's word beats the photo's colours."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.mattes import Mattes
from forestgen.tree.strokes import DensityStroke

SHIFT = 4  # bits of OpenCV's fractions of a pixel
RAGGED = 0.65  # of a brush's radius: how deep its edge is bitten, as foliage ends in tufts and no hedge is a pipe
TUFTS = ((1.1, 0.4), (0.4, 0.35), (0.15, 0.25))  # (size as a share of the radius, weight) of those tufts


def paint(mattes: Mattes, density: Sequence[DensityStroke], *, rng: np.random.Generator) -> Mattes:
    """Mattes with the strokes painted over them, in their order; painted foliage hides the wood behind it."""
    if not density:
        return mattes
    foliage = mattes.foliage.copy()
    for stroke in density:
        cover = tufted(stroke, foliage.shape, rng=rng)
        foliage = np.maximum(foliage, cover) if stroke.add else np.minimum(foliage, 1 - cover)
    return Mattes(foliage, np.minimum(mattes.branch, 1 - foliage))


def painted_over(density: Sequence[DensityStroke], shape: tuple[int, ...], margin_px: float = 0.0) -> NDArray[np.bool_]:
    """Pixels (H, W) where somebody painted foliage, and a margin around: the photo does not show what grows there."""
    added = np.zeros(shape, bool)
    for stroke in density:
        if stroke.add:
            added |= distance(stroke, shape) <= stroke.radius_px + margin_px
    return added


def tufted(stroke: DensityStroke, shape: tuple[int, ...], *, rng: np.random.Generator) -> NDArray[np.float32]:
    """How much of each pixel (H, W) one stroke covers, in [0, 1]: all along its middle, in tufts at its edge."""
    away = distance(stroke, shape)
    bite = np.zeros(shape, np.float32)
    for size, weight in TUFTS:
        cell = max(1.0, size * stroke.radius_px)
        grid = rng.random((int(shape[0] / cell) + 2, int(shape[1] / cell) + 2)).astype(np.float32)
        bite += np.float32(weight) * cv2.resize(grid, shape[::-1], interpolation=cv2.INTER_CUBIC)
    reach = stroke.radius_px * (1 - RAGGED * np.clip(bite, 0, 1))
    return np.asarray(np.clip(reach - away + np.float32(0.5), 0, 1), np.float32)


def distance(stroke: DensityStroke, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Distance (H, W) of each pixel's middle from a stroke's line, px."""
    line = np.full(shape, 255, np.uint8)
    points = np.round((stroke.path - 0.5) * (1 << SHIFT)).astype(np.int32)
    cv2.polylines(line, [points], False, 0, 1, cv2.LINE_8, SHIFT)
    column, row = np.floor(stroke.path[0]).astype(int).clip(0, np.array(shape[::-1]) - 1)
    line[row, column] = 0  # a mere dab
    return np.asarray(cv2.distanceTransform(line, cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32)
