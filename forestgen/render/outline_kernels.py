"""Compiled inner loops of outlines: the cells that points fall on, and the foremost thing along each stretch.

For an oak's 2.7 million points, from twelve sides, whole arrays took 0.54 s of processor time, and this takes 0.07 s.
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@nb.njit(cache=True, nogil=True)
def mark(x: Array, y: Array, width: int, cell: Array, mask: Array) -> None:
    """The cells (N,) of points at x and y (N,) cells right and down from the middle, and 1 there in a mask (W * W,)."""
    half = np.float32(width / 2)
    for p in range(len(x)):
        at = np.int32(y[p] + half) * width + np.int32(x[p] + half)
        cell[p] = at
        mask[at] = 1


@nb.njit(cache=True, nogil=True)
def foremost(cell: Array, owner: Array, depth: Array, label: Array, reach: Any, step: int) -> Any:
    """The thing that lies least deep along each stretch of an outline (K * K,), the first of equals, -1 for none.

    Points (N,) fall on cells and belong to things `owner` (N,), or to none where that is -1; those deeper than `reach`
    do not count. Of each cell (W, W) the depth is known, 0 outside, and the label of the outside cell next to it,
    which is its own. Outside cells of the same square of `step` cells are one stretch.
    """
    width = len(depth)
    across = (width + step - 1) // step
    stretch = np.zeros(label.max() + 1, np.int64)
    for row in range(width):
        for column in range(width):
            if depth[row, column] == 0:
                stretch[label[row, column]] = row // step * across + column // step
    least = np.full(across * across, np.inf, np.float32)
    found = np.full(across * across, -1, np.int64)
    depths, labels = depth.ravel(), label.ravel()
    for p in range(len(cell)):
        deep = depths[cell[p]]
        if owner[p] < 0 or deep > reach:
            continue
        s = stretch[labels[cell[p]]]
        if deep < least[s] or (deep == least[s] and owner[p] < found[s]):
            least[s], found[s] = deep, owner[p]
    return found
