"""Which leaves and twigs draw a crown's outline: those near the edge of its silhouette from some side."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_fill_holes

from forestgen.camera import Camera
from forestgen.tree.scale import disc

SIDES = tuple((k * np.pi / 8, 0.0) for k in range(8)) + tuple((k * np.pi / 2, np.pi / 6) for k in range(4))
CELLS = 160  # cells of the grid along the longest extent
CLOSING = 0.02  # share of that extent: gaps up to twice this wide are no outline
ROOM = 6  # empty cells around
HOLE = 0.01  # share of the silhouette above which a gap in it has an outline of its own
OUTLINE_WEIGHT = 8.0  # how much likelier it is that what draws the outline stays, over what lies inside
AT_OUTLINE, INSIDE = 0.01, 0.02  # depths down to which that holds in full, and from which on not at all


def outline_weight(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """OUTLINE_WEIGHT for points (N, 3) at the outline of all from some side, 1 for those well inside (N,)."""
    inward = (depth_below_outline(points) - AT_OUTLINE) / (INSIDE - AT_OUTLINE)
    return np.asarray(1 + (OUTLINE_WEIGHT - 1) * (1 - np.clip(inward, 0, 1)))


def depth_below_outline(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far (N,) each point (N, 3) lies inside the silhouette of all, at the side where that is least.

    In shares of the points' longest extent, to one part in CELLS; silhouettes are closed and their small holes filled.
    """
    if not len(points):
        return np.zeros(0)
    span = max(float(np.ptp(points, axis=0).max()), 1e-12)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    width = int(np.ceil(np.sqrt(3) * CELLS)) + 2 * ROOM
    least = np.full(len(points), np.inf)
    for azimuth, elevation in SIDES:
        camera = Camera((width, width), (width / 2, width / 2), CELLS / span, azimuth, elevation)
        column, row = np.floor(camera.project(points - centre)).astype(np.int64).T
        mask = np.zeros((width, width), np.uint8)
        mask[row, column] = 1
        closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, disc(CLOSING * CELLS))
        inside = np.pad(without_small_holes(closed > 0).astype(np.uint8), 1)
        depth = cv2.distanceTransform(inside, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
        least = np.minimum(least, depth[row, column])
    return np.asarray((least - 0.5) / CELLS)


def without_small_holes(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The mask (H, W) with its holes filled, but for those that are seen as such."""
    filled = np.asarray(binary_fill_holes(mask), np.bool_)
    _, label, stats, _ = cv2.connectedComponentsWithStats((filled & ~mask).astype(np.uint8), connectivity=4)
    is_large = stats[:, cv2.CC_STAT_AREA] > HOLE * np.count_nonzero(filled)
    is_large[0] = False
    return np.asarray(filled & ~is_large[label], np.bool_)
