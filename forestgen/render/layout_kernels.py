"""Compiled inner loops of the cards' layout: boxes, where a card is best cut in two, corners placed on cards.

For a bare oak's 280,000 faces of thin wood, each on three cards, whole arrays took 0.24 + 0.88 + 0.22 s of processor
time to find the boxes, to deal and cut the cards, and to place the corners, and this takes 0.01 + 0.32 + 0.08 s.
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@nb.njit(cache=True, nogil=True)
def boxes(points: Array, faces: Array, axes: Array, low: Array, high: Array) -> None:
    """Least and greatest coordinates of faces (T, 3) of points (P, 3) along axes (K, 3, 3), into (T, K, 3)."""
    for t in range(len(faces)):
        for k in range(len(axes)):
            for a in range(3):
                least, most = np.inf, -np.inf
                for corner in faces[t]:
                    x = axes[k, a, 0] * points[corner, 0]
                    x += axes[k, a, 1] * points[corner, 1]
                    x += axes[k, a, 2] * points[corner, 2]
                    least, most = min(least, x), max(most, x)
                low[t, k, a], high[t, k, a] = least, most


@nb.njit(cache=True, nogil=True)
def box_around(low: Array, high: Array, member: Array, family: int) -> Any:
    """The box (2, 3) around members (M,) of things with boxes (N, K, 3), along the axes of one of K families."""
    box = np.empty((2, 3))
    for a in range(3):
        least, most = np.inf, -np.inf
        for m in member:
            least, most = min(least, low[m, family, a]), max(most, high[m, family, a])
        box[0, a], box[1, a] = least, most
    return box


@nb.njit(cache=True, nogil=True)
def best_place(low: Array, high: Array, order: Array, margin: float) -> Any:
    """Where to cut things with boxes (M, 2) in some order (M,): after which one, and the areas of both parts and whole.

    Those are areas of the boxes around, `margin` metres wider and higher. Of equally good places the first.
    """
    n = len(order)
    area = np.empty(n)
    x0, y0, x1, y1 = np.inf, np.inf, -np.inf, -np.inf
    for m in range(n):
        k = order[m]
        x0, y0, x1, y1 = min(x0, low[k, 0]), min(y0, low[k, 1]), max(x1, high[k, 0]), max(y1, high[k, 1])
        area[m] = (x1 - x0 + margin) * (y1 - y0 + margin)
    at, least = n - 1, np.inf
    x0, y0, x1, y1 = np.inf, np.inf, -np.inf, -np.inf
    for m in range(n - 2, -1, -1):
        k = order[m + 1]
        x0, y0, x1, y1 = min(x0, low[k, 0]), min(y0, low[k, 1]), max(x1, high[k, 0]), max(y1, high[k, 1])
        both = area[m] + (x1 - x0 + margin) * (y1 - y0 + margin)
        if both <= least:
            at, least = m, both
    return at, least, area[n - 1]


@nb.njit(cache=True, nogil=True)
def placed(corner: Array, frame: Array, card: Array) -> Any:
    """Corners (T, 3, 3) in the frames (C, 4, 4) of their cards (T,)."""
    out = np.empty(corner.shape)
    for t in range(len(corner)):
        place = frame[card[t]]
        for c in range(3):
            x, y, z = corner[t, c]
            for a in range(3):
                out[t, c, a] = place[a, 0] * x + place[a, 2] * z + place[a, 1] * y + place[a, 3]
    return out
