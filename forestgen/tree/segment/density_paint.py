"""Painted foliage and painted holes (Neubert et al. 2007, sec. 9): the user's word beats the colours."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.strokes import DensityStroke


def paint(alpha: NDArray[np.float32], density: Sequence[DensityStroke]) -> NDArray[np.float32]:
    """A foliage matte (H, W) of the whole photo with the strokes painted over it, in their order."""
    out = alpha.copy()
    for stroke in density:
        brush = np.zeros(alpha.shape, np.uint8)
        points = [np.round((stroke.path - 0.5) * 16).astype(np.int32)]
        width = max(1, round(2 * stroke.radius_px))
        cv2.polylines(brush, points, False, 255, width, cv2.LINE_AA, 4)
        cv2.circle(brush, points[0][0].tolist(), round(stroke.radius_px * 16), 255, -1, cv2.LINE_AA, 4)  # a mere dab
        cover = brush.astype(np.float32) / 255
        out = np.maximum(out, cover) if stroke.add else np.minimum(out, 1 - cover)
    return out
