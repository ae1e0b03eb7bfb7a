"""Ways: from every pixel of a picture the cheapest way to the nearest source."""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

STRAIGHT, DIAGONAL = 5, 7  # price of a step from a pixel of cost 1 to its neighbour
FAR = 2**30  # of pixels from which there is no way


@nb.njit(cache=True, nogil=True)
def cheapest_ways(cost: NDArray[Any], is_source: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """What the way from each pixel (h, w) costs, and the flat index of the next pixel on it, -1 at sources.

    `cost` (h, w) is what a pixel costs to step on, 0 where no way leads. Raster sweeps down and up
    until nothing changes: as fast as a queue on ways with few turns, and simpler.
    """
    h, w = cost.shape
    price = np.full((h, w), FAR, np.int32)
    following = np.full((h, w), -1, np.int32)
    for y in range(h):
        for x in range(w):
            if is_source[y, x]:
                price[y, x] = 0
    changed = True
    while changed:
        changed = False
        for sign in (1, -1):
            for i in range(h):
                y = i if sign > 0 else h - 1 - i
                for turn in (1, -1):  # along the row both ways, so that level runs take one sweep
                    for j in range(w):
                        x = j if sign * turn > 0 else w - 1 - j
                        if cost[y, x] == 0:
                            continue
                        for dy, dx in ((-sign, -1), (-sign, 0), (-sign, 1), (0, -sign * turn)):
                            ny, nx = y + dy, x + dx
                            if ny < 0 or ny >= h or nx < 0 or nx >= w:
                                continue
                            step = DIAGONAL if dy != 0 and dx != 0 else STRAIGHT
                            there = price[ny, nx] + step * cost[y, x]
                            if there < price[y, x]:
                                price[y, x] = there
                                following[y, x] = ny * w + nx
                                changed = True
    return price, following
