"""An order of points that is even in space: a space-filling curve, dealt out by bit reversal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BITS = 10  # a side of the grid of the space-filling curve


def morton(position: NDArray[np.float64], levels: float) -> NDArray[np.int64]:
    """Place (N,) along Morton's space-filling curve of the cell of points (N, 3), on a cubic grid of about
    2^levels cells a side of the points' box."""
    span = max(float(np.ptp(position, axis=0).max(initial=0.0)), 1e-12)
    cell = np.floor((position - position.min(axis=0)) / span * 2.0 ** min(max(levels, 0.0), BITS) * 0.999999)
    code = np.zeros(len(position), np.int64)
    for bit in range(BITS):
        for axis in range(3):
            code |= ((cell[:, axis].astype(np.int64) >> bit) & 1) << (3 * bit + axis)
    return code


def bit_reversed(n: int) -> NDArray[np.float64]:
    """The first n numbers of van der Corput's sequence in [0, 1): any stretch of it is spread evenly."""
    bits = max(1, int(n - 1).bit_length())
    index = np.arange(n, dtype=np.int64)
    out = np.zeros(n)
    for bit in range(bits):
        out += ((index >> bit) & 1) * 0.5 ** (bit + 1)
    return out
