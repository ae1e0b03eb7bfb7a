"""Cards that last on smaller mip levels: alpha raised where, averaged, too little would pass one half.

A card shows a few leaves: averaged over four or sixteen texels none of them covers one half, and where a reader
makes plain mip levels and tests them at 0.5, the tree is gone. There is room, though: on the texture itself only
the side of 0.5 counts on which a texel lies. So texels are raised within their side, first those that are shown,
until of each smaller level as much passes as there is coverage. (Castaño 2010 scales whole levels instead, which
asks for readers that take levels made by others.)
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.render.card_cutout import LEAST, cutout_alpha, local_threshold, shown_area
from forestgen.render.card_kernels import raise_blocks

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
    wanted = [_wanted(coverage, goal, n) for n in LEVELS]
    slim = goal * np.float32(SWELLS)
    for _ in range(SLIMMINGS):
        alpha = _raised(cutout_alpha(coverage, slim), wanted)
        area, whole = (cv2.boxFilter(image, -1, (NEAR, NEAR)) for image in (shown_area(alpha), goal))
        slim = slim * np.clip(whole / np.maximum(area, LEAST), LEANEST, 1)
    return _raised(cutout_alpha(coverage, slim), wanted)


def _wanted(coverage: NDArray[np.float32], goal: NDArray[np.float32], n: int) -> NDArray[np.bool_]:
    """Whether texels (H / n, W / n) of a smaller level are to be shown."""
    mean = block_means(coverage, n)
    return np.asarray(mean > local_threshold(mean, block_means(goal, n), 1))


def _raised(alpha: NDArray[np.float32], wanted: Sequence[NDArray[np.bool_]]) -> NDArray[np.float32]:
    """Alpha with the same texels at one half or above, but higher where smaller levels, as in LEVELS, want it."""
    is_shown = alpha >= 0.5
    most = np.where(is_shown, np.float32(1), np.maximum(alpha, np.float32(FLOOR)))
    raised = alpha.copy()
    for _ in range(ROUNDS):
        for is_wanted in wanted:
            raise_blocks(raised, is_shown, most, is_wanted, ABOVE)
    return raised


def block_means(image: NDArray[np.float32], n: int) -> NDArray[np.float32]:
    """Means (H / n, W / n) of blocks of n x n texels: a mip level."""
    height, width = image.shape
    return np.asarray(cv2.resize(image, (width // n, height // n), interpolation=cv2.INTER_AREA), np.float32)
