"""Region: the part of a photo that segmentation looks at, and what the strokes say of each of its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.strokes import Strokes, draw_polyline, fill_outline

REFERENCE_SIDE = 1500  # px; lengths in pixels are meant for a photo of this longer side and scale with it
RING = 0.2  # width of the ring about the crown, as a share of the crown's size: wide enough for sky and ground


@dataclass(frozen=True, eq=False)
class Region:
    """A window of a photo, h x w pixels. Distances in px, positive inside the crown outline."""

    window: tuple[slice, slice]  # rows and columns of the photo
    rgb: NDArray[np.float32]  # (h, w, 3) sRGB in [0, 1]
    depth: NDArray[np.float32]  # (h, w) distance from the crown outline
    is_ring: NDArray[np.bool_]  # (h, w) outside the widened crown, but near it, or a background stroke
    is_inside: NDArray[np.bool_]  # (h, w) the crown widened by the dilations
    size_px: float  # square root of the crown's area: the scale of this tree

    def local(self, path: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (K, 2) of the photo, px, as points of the window."""
        return np.asarray(path - [self.window[1].start, self.window[0].start])

    def full(self, values: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
        """A matte of the whole photo (H, W) from one of the window, 0 elsewhere."""
        out = np.zeros(size[::-1], np.float32)
        out[self.window] = values
        return out


def dilations_px(dilations: int, size: tuple[int, int]) -> int:
    """The paper's number of dilations, scaled from a 1500 px photo to one of this (width, height)."""
    return max(1, round(dilations * max(size) / REFERENCE_SIDE))


def look_at(rgb: NDArray[np.uint8], strokes: Strokes, dilations: int) -> Region:
    """The window about the crown and the branch strokes, with its masks."""
    height, width = rgb.shape[:2]
    is_crown = fill_outline(strokes.crown, (width, height))
    area = int(is_crown.sum())
    widen = dilations_px(dilations, (width, height))
    margin = round(RING * area**0.5) + widen
    marks = np.concatenate([strokes.crown, *strokes.branches, *strokes.background])
    low = np.maximum(np.floor(marks.min(axis=0)).astype(int) - margin, 0)
    high = np.minimum(np.ceil(marks.max(axis=0)).astype(int) + margin, [width, height])
    window = (slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0])))
    crown = is_crown[window].astype(np.uint8)
    depth = cv2.distanceTransform(crown, cv2.DIST_L2, 5) - cv2.distanceTransform(1 - crown, cv2.DIST_L2, 5)
    is_inside = depth > -widen - 0.5
    is_ring = (depth > -margin) & ~is_inside
    is_wood = np.zeros_like(is_ring)
    for path in strokes.branches:
        is_wood |= draw_polyline(path, (width, height), max(3, margin // 3))[window]
    is_ring &= ~is_wood
    for path in strokes.background:
        is_ring |= draw_polyline(path, (width, height), max(3, widen // 2))[window]
    pixels = rgb[window].astype(np.float32) / np.float32(255)
    return Region(window, pixels, depth.astype(np.float32), is_ring, is_inside, float(area**0.5))


def bounding(mask: NDArray[np.bool_]) -> tuple[slice, slice]:
    """The smallest window that holds a mask (h, w); empty where the mask is."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return slice(0, 0), slice(0, 0)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
