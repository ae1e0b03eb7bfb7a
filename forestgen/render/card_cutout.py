"""Cut-outs from pictures of soft edges: alpha that shows as much as there is, colour bled under its edges."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.render.card_kernels import bleed, halfway, halve, show

NEAR = 3  # texels; over so wide a square, as `halve` has it, the covered area is kept
FINER = 3  # places a texel along each way, at which interpolated alpha is judged
HALVINGS = 8  # of the interval that holds a local threshold
HIGHEST = 1 - 1 / 700  # threshold: halved, it falls a little below each sixteenth, which is what samples count in
LEAST = 1 / 255  # coverage below which a texel stays clear
ENOUGH = 0.3  # coverage from which a texel lends its colour to those with too little
OWN = 0.05  # coverage from which a texel keeps its own colour


def cutout_alpha(coverage: NDArray[np.float32], goal: NDArray[np.float32]) -> NDArray[np.float32]:
    """Alpha (H, W) in [0, 1] of which, interpolated, the share above one half is everywhere that of `goal`.

    `coverage` (H, W) is the share of each texel that is covered: what it holds is shown first where it is most.
    """
    threshold = local_threshold(coverage, goal, FINER)
    alpha = np.clip(coverage / (2 * threshold), 0, 1)
    return np.where(coverage < LEAST, np.float32(0), alpha).astype(np.float32)


def local_threshold(coverage: NDArray[np.float32], goal: NDArray[np.float32], finer: int) -> NDArray[np.float32]:
    """The coverage (H, W) from which a texel is shown, so that as much of its neighbourhood is as `goal` says.

    Thin and sparse things never cover half a texel, and would vanish; full ones would swell. So each texel has
    a threshold of its own, found by halving, judged at `finer` samples, 1 or 3, a texel along each way.
    """
    wanted = cv2.boxFilter(goal, -1, (NEAR, NEAR))
    around = np.pad(coverage, 1, mode="edge")
    middle, area = np.zeros_like(around), np.zeros_like(around)
    low, high = np.zeros_like(coverage), np.full_like(coverage, HIGHEST)
    for _ in range(HALVINGS):
        halfway(low, high, middle)
        show(around, middle, finer, area)
        halve(low, high, middle, area, wanted)
    return np.asarray(np.maximum((low + high) / 2, LEAST), np.float32)


def shown_area(alpha: NDArray[np.float32]) -> NDArray[np.float32]:
    """The share (H, W) of each texel in which interpolated alpha exceeds one half."""
    around = np.pad(alpha, 1, mode="edge")
    area = np.zeros_like(around)
    show(around, np.full_like(around, 0.5), FINER, area)
    return area[1:-1, 1:-1].copy()


def bled(picture: NDArray[np.float32], alpha: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Straight colours of a premultiplied picture (H, W, 4) under another alpha (H, W).

    A texel that is hardly covered takes the colour of the nearest one that is: so no mip level fringes.
    """
    fullest = float(picture[..., 3].max(initial=0))
    if fullest < LEAST:
        return np.zeros(picture.shape, np.uint8)
    enough = np.float32(min(ENOUGH, fullest / 2))
    _, label = cv2.distanceTransformWithLabels(
        (picture[..., 3] < enough).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    texture = np.zeros(picture.shape, np.uint8)
    bleed(picture, alpha, label, enough, np.float32(OWN), texture)
    return texture
