"""Cards that last on smaller mip levels: alpha raised where, averaged, too little would pass one half.

A card shows a few leaves: averaged over four or sixteen texels none of them covers one half, and where a reader
makes plain mip levels and tests them at 0.5, the tree is gone. There is room, though: on the texture itself only
the side of 0.5 counts on which a texel lies. So texels are raised within their side, first those that are shown,
until of each smaller level as much passes as there is coverage. (Castaño 2010 scales whole levels instead, which
asks for readers that take levels made by others.)
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.render.card_cutout import LEAST, cutout_alpha, local_threshold, shown_area

LEVELS = (8, 4, 2)  # texels averaged along each way: three mip levels
ABOVE = 0.62  # mean alpha that a shown texel of a smaller level should have, so that it covers when interpolated
FLOOR = 0.45  # the most that a texel is raised to that is not shown itself
SWELLS = 0.85  # the share of the area that is cut out at first
SLIMMINGS = 2  # times that this is corrected
LEANEST = 0.3  # the most that one correction takes away
NEAR = 7  # texels; over so wide a square it is judged
ROUNDS = 4  # levels share their texels, so raising one moves the others


def lasting_alpha(coverage: NDArray[np.float32], goal: NDArray[np.float32]) -> NDArray[np.float32]:
    """Alpha (H, W) of which, at one half, as much is shown as `goal` (H, W) says, on plain mip levels too.

    Sides of powers of two, 8 at least. `coverage` (H, W) says what is shown first. Raised alpha swells what is
    shown of the texture itself, where it is interpolated: as much less is cut out at first.
    """
    slim = goal * np.float32(SWELLS)
    for _ in range(SLIMMINGS):
        alpha = _raised(cutout_alpha(coverage, slim), coverage, goal)
        area, wanted = (cv2.boxFilter(image, -1, (NEAR, NEAR)) for image in (shown_area(alpha), goal))
        slim = slim * np.clip(wanted / np.maximum(area, LEAST), LEANEST, 1)
    return _raised(cutout_alpha(coverage, slim), coverage, goal)


def _raised(
    alpha: NDArray[np.float32], coverage: NDArray[np.float32], goal: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Alpha with the same texels at one half or above, but higher where a smaller level needs it."""
    is_shown = alpha >= 0.5
    wanted = {}
    for n in LEVELS:
        mean = block_means(coverage, n)
        wanted[n] = mean > local_threshold(mean, block_means(goal, n), 1)
    most = np.where(is_shown, np.float32(1), np.maximum(alpha, np.float32(FLOOR)))
    for _ in range(ROUNDS):
        for n in LEVELS:
            lack = np.where(wanted[n], np.maximum(np.float32(ABOVE) - block_means(alpha, n), 0), np.float32(0))
            for may_rise in (is_shown, ~is_shown):
                room = np.where(may_rise, most - alpha, np.float32(0)).astype(np.float32)
                free = block_means(room, n)
                part = np.minimum(lack / np.maximum(free, np.float32(1e-6)), np.float32(1))
                alpha = alpha + room * _spread(part, n)
                lack = lack - part * free
    return alpha


def block_means(image: NDArray[np.float32], n: int) -> NDArray[np.float32]:
    """Means (H / n, W / n) of blocks of n x n texels: a mip level."""
    height, width = image.shape
    return np.asarray(cv2.resize(image, (width // n, height // n), interpolation=cv2.INTER_AREA), np.float32)


def _spread(image: NDArray[np.float32], n: int) -> NDArray[np.float32]:
    return image.repeat(n, axis=0).repeat(n, axis=1)
