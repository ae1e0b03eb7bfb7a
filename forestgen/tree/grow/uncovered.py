"""Uncovered foliage: what a photo shows as leaves and no wood of the tree comes near in the picture."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.camera import Camera

SHIFT = 4  # binary digits of a pixel that lines are drawn to


def picture_of(camera: Camera, position: NDArray[np.float64], parent: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Pixels (H, W) under the lines of a skeleton (N,), one pixel wide."""
    width, height = camera.size
    drawn = np.zeros((height, width), np.uint8)
    ends = np.clip(camera.project(position) - 0.5, -width - height, 2 * (width + height))
    lines = np.stack([ends[parent[1:]], ends[1:]], axis=1)
    cv2.polylines(drawn, list(np.round(lines * 2**SHIFT).astype(np.int32)), False, 1, 1, cv2.LINE_8, SHIFT)
    return drawn > 0


def uncovered_places(
    camera: Camera,
    leafy: NDArray[np.bool_],
    position: NDArray[np.float64],
    parent: NDArray[np.int64],
    spacing: float,
) -> NDArray[np.float64]:
    """Points (S, 3), metres, where foliage (H, W) is farther than `spacing` from any wood in the picture.

    They lie `spacing` apart across the view, and as deep as the wood that is nearest in the picture.
    """
    away = cv2.distanceTransform((~picture_of(camera, position, parent)).astype(np.uint8), cv2.DIST_L2, 5)
    bare = leafy & (away > spacing * camera.px_per_metre)
    step = max(1.0, spacing * camera.px_per_metre)
    row, column = np.nonzero(bare)
    # one pixel of each cell of a grid: the one farthest from wood
    cell = (row // step).astype(np.int64) * leafy.shape[1] + (column // step).astype(np.int64)
    order = np.lexsort((-away[row, column], cell))
    first = order[np.unique(cell[order], return_index=True)[1]]
    xy = np.column_stack([column[first], row[first]]) + 0.5
    _, nearest = cKDTree(camera.project(position)).query(xy)
    return camera.unproject(xy, camera.depth(position)[nearest])
