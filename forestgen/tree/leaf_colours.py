"""Colours of pixels and how they are grouped: CIELAB, and groups that span them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def lab_of(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """CIELAB (..., 3), L in [0, 100], of sRGB bytes (..., 3)."""
    flat = np.ascontiguousarray(rgb.reshape(1, -1, 3)).astype(np.float32) / np.float32(255)
    return np.asarray(cv2.cvtColor(flat, cv2.COLOR_RGB2LAB), np.float32).reshape(rgb.shape)


def split_colours(lab: NDArray[np.float64], weight: NDArray[np.float64], n: int) -> NDArray[np.int64]:
    """Group (P,) of colours (P, 3) in at most n groups: the group that varies most is cut at its mean.

    The cut is across the direction of greatest variance. No chance is involved.
    """
    group = np.zeros(len(lab), np.int64)
    spread = [_spread(lab, weight)]
    while len(spread) < n:
        widest = int(np.argmax([s[0] for s in spread]))
        energy, direction, mean = spread[widest]
        if energy <= 0:
            break
        member = np.flatnonzero(group == widest)
        far = member[(lab[member] - mean) @ direction > 0]
        if not 0 < len(far) < len(member):
            spread[widest] = (0.0, direction, mean)
            continue
        group[far] = len(spread)
        near = np.flatnonzero(group == widest)
        spread[widest] = _spread(lab[near], weight[near])
        spread.append(_spread(lab[far], weight[far]))
    return group


def _spread(
    lab: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Summed squared deviation along the direction of greatest variance, that direction, and the mean."""
    mean = np.average(lab, axis=0, weights=weight)
    away = lab - mean
    value, vector = np.linalg.eigh((away * weight[:, None]).T @ away)
    return (float(value[-1]) if len(lab) > 1 else 0.0), vector[:, -1], mean
