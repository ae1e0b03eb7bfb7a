"""Alpha of a cut-out that shows as much as there is: local thresholds instead of one for all."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

NEAR = 3  # texels; over so wide a square the covered area is kept
FINER = 3  # samples a texel along each way, at which interpolated alpha is judged
HALVINGS = 9  # of the interval that holds a local threshold
LEAST = 1 / 255  # coverage below which a texel stays clear


def cutout_alpha(coverage: NDArray[np.float32], goal: NDArray[np.float32]) -> NDArray[np.float32]:
    """Alpha (H, W) in [0, 1] of which, interpolated, the share above one half is everywhere that of `goal`.

    `coverage` (H, W) is the share of each texel that is covered: what it holds is shown first where it is most.
    Thin and sparse things never cover half a texel, and would vanish; full ones would swell. So each texel
    has a threshold of its own, found by halving, that keeps the area in its neighbourhood.
    """
    near = (NEAR, NEAR)
    size = coverage.shape[::-1]
    finer = (size[0] * FINER, size[1] * FINER)
    wanted = cv2.boxFilter(goal, -1, near)
    fine = cv2.resize(coverage, finer, interpolation=cv2.INTER_LINEAR)
    low, high = np.zeros_like(coverage), np.ones_like(coverage)
    for _ in range(HALVINGS):
        threshold = (low + high) / 2
        shown = (fine > cv2.resize(threshold, finer, interpolation=cv2.INTER_LINEAR)).astype(np.float32)
        is_too_much = cv2.boxFilter(cv2.resize(shown, size, interpolation=cv2.INTER_AREA), -1, near) > wanted
        low, high = np.where(is_too_much, threshold, low), np.where(is_too_much, high, threshold)
    threshold = np.maximum((low + high) / 2, LEAST)
    alpha = np.clip(coverage / (2 * threshold), 0, 1)
    return np.where(coverage < LEAST, np.float32(0), alpha).astype(np.float32)
