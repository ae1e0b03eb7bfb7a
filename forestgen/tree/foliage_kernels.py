"""Leaves looked up in a photo, sample by sample.

On an oak's leaves 2.6 times as fast as numpy, which is kept in the tests (0.17 s of 0.45).
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray


@nb.njit(cache=True, nogil=True)
def look_up(
    samples: NDArray[np.float64],
    prototype: NDArray[np.int64],
    base: NDArray[np.float64],
    step: NDArray[np.float64],
    depth: NDArray[np.float64],
    toward: NDArray[np.float64],
    is_foliage: NDArray[np.bool_],
    is_open: NDArray[np.bool_],
    wood_depth: NDArray[np.float32],
    inside: NDArray[np.float64],
    gain: NDArray[np.float64],
    pixel: NDArray[np.int64],
) -> None:
    """Fill a footprint's `inside` (L,), `gain` (L,) and `pixel` (L, S); see `foliage_fit.Footprint`.

    A leaf's `samples` (P, S, 3) in leaf space fall on `base` (L, 2) + sample @ `step` (L, 3, 2) px, and
    lie at `depth` (L,) + sample @ `toward` (L, 3), metres towards the camera.
    """
    height, width = is_foliage.shape
    n_samples = samples.shape[1]
    for leaf in range(len(base)):
        fits, wins = 0, 0
        for k in range(n_samples):
            x, y, z = samples[prototype[leaf], k]
            column = int(np.floor(x * step[leaf, 0, 0] + y * step[leaf, 1, 0] + z * step[leaf, 2, 0] + base[leaf, 0]))
            row = int(np.floor(x * step[leaf, 0, 1] + y * step[leaf, 1, 1] + z * step[leaf, 2, 1] + base[leaf, 1]))
            pixel[leaf, k] = -1
            if column < 0 or row < 0 or column >= width or row >= height:
                continue
            far = x * toward[leaf, 0] + y * toward[leaf, 1] + z * toward[leaf, 2] + depth[leaf]
            if far < wood_depth[row, column]:  # hidden behind wood
                fits += 1
                continue
            fits += is_foliage[row, column]
            wins += is_open[row, column]
            pixel[leaf, k] = row * width + column
        inside[leaf], gain[leaf] = fits / n_samples, wins / n_samples
