"""Compiled inner loops of the cards' alpha: what is shown of texels, halvings of thresholds, raising by blocks.

They round as OpenCV does, which the tests hold them against. To find the alpha of an oak's 1024 px texture by whole
pictures took 0.79 s of processor time, and takes 0.15 s; to bleed its colours 0.056 s, and 0.017 s.
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

LITTLE = np.float32(1e-6)  # divided by instead of 0
THIRD, TWO_THIRDS = float(np.float32(1 / 3)), float(np.float32(2 / 3))


@nb.njit(cache=True, nogil=True)
def show(image: Array, threshold: Array, finer: int, area: Array) -> None:
    """The share of each texel in which an image exceeds a threshold, into `area`; all (1 + H + 1, 1 + W + 1).

    Judged at 1 or, interpolated, 3 x 3 places a texel (`finer` 1 or 3). Of image and threshold the edges are repeated
    around, those of the area are mirrored.
    """
    height, width = image.shape[0] - 2, image.shape[1] - 2
    for row in range(height):
        a, b, c = image[row], image[row + 1], image[row + 2]
        d, e, f = threshold[row], threshold[row + 1], threshold[row + 2]
        shown = area[row + 1]
        if finer == 1:
            for x in range(width):
                shown[x + 1] = np.float32(b[x + 1] > e[x + 1])
        else:
            for x in range(width):
                shown[x + 1] = np.float32(_above(_nine(a, b, c, x), _nine(d, e, f, x))) / np.float32(9)
        shown[0], shown[width + 1] = shown[min(2, width)], shown[max(width - 1, 1)]
    for x in range(width + 2):
        area[0, x], area[height + 1, x] = area[min(2, height), x], area[max(height - 1, 1), x]


@nb.njit(cache=True, nogil=True)
def _above(some: Any, others: Any) -> Any:
    """How many of nine numbers are greater than nine others."""
    a, b, c, d, e, f, g, h, i = some
    j, k, m, n, o, p, q, r, s = others
    return (a > j) + (b > k) + (c > m) + (d > n) + (e > o) + (f > p) + (g > q) + (h > r) + (i > s)


@nb.njit(cache=True, nogil=True)
def _nine(above: Array, row: Array, below: Array, x: int) -> Any:
    """3 x 3 places in the texel after the x-th of a row, interpolated along rows first."""
    a, b, c = _three(above[x], above[x + 1], above[x + 2])
    d, e, f = _three(row[x], row[x + 1], row[x + 2])
    g, h, i = _three(below[x], below[x + 1], below[x + 2])
    return _three(a, d, g) + _three(b, e, h) + _three(c, f, i)


@nb.njit(cache=True, nogil=True)
def _three(before: Any, here: Any, after: Any) -> Any:
    """Three places in a texel, a third of one apart; multiplied and added without rounding in between."""
    return (
        np.float32(np.float64(here - before) * TWO_THIRDS + np.float64(before)),
        here,
        np.float32(np.float64(after - here) * THIRD + np.float64(here)),
    )


@nb.njit(cache=True, nogil=True)
def halfway(low: Array, high: Array, middle: Array) -> None:
    """The middles of intervals (H, W) into `middle` (1 + H + 1, 1 + W + 1), its edges repeated around."""
    height, width = low.shape
    for row in range(height):
        for x in range(width):
            middle[row + 1, x + 1] = (low[row, x] + high[row, x]) * np.float32(0.5)
        middle[row + 1, 0], middle[row + 1, -1] = middle[row + 1, 1], middle[row + 1, -2]
    middle[0], middle[-1] = middle[1], middle[-2]


@nb.njit(cache=True, nogil=True)
def halve(low: Array, high: Array, middle: Array, area: Array, wanted: Array) -> None:
    """Keep the upper half of those intervals (H, W) whose middle shows more than `wanted` (H, W), else the lower one.

    What it shows is the mean `area` of 3 x 3 texels; that and the middle are (1 + H + 1, 1 + W + 1).
    """
    height, width = low.shape
    for row in range(height):
        for x in range(width):
            total = np.float64(0)
            for i in range(3):
                for j in range(3):
                    total += np.float64(area[row + i, x + j])
            here = middle[row + 1, x + 1]
            is_too_much = np.float32(total * (1 / 9)) > wanted[row, x]
            low[row, x] = here if is_too_much else low[row, x]
            high[row, x] = high[row, x] if is_too_much else here


@nb.njit(cache=True, nogil=True)
def raise_blocks(alpha: Array, is_shown: Array, most: Array, is_wanted: Array, mean: float) -> None:
    """Raise those blocks of alpha (H, W) that are wanted (H / n, W / n) to a mean, in place, none above `most` (H, W).

    Texels that are shown rise first, the others by what then lacks. n is 2, or a multiple of 4.
    """
    n = alpha.shape[0] // is_wanted.shape[0]
    room = np.zeros((n, n), np.float32)
    for row in range(is_wanted.shape[0]):
        for column in range(is_wanted.shape[1]):
            if not is_wanted[row, column]:
                continue
            top, left = n * row, n * column
            lack = np.float32(mean) - block_mean(alpha, top, left, n)
            if lack <= 0:
                continue
            for may_rise in (True, False):
                for i in range(n):
                    for j in range(n):
                        y, x = top + i, left + j
                        room[i, j] = most[y, x] - alpha[y, x] if is_shown[y, x] == may_rise else np.float32(0)
                free = block_mean(room, 0, 0, n)
                part = min(lack / max(free, LITTLE), np.float32(1))
                for i in range(n):
                    for j in range(n):
                        alpha[top + i, left + j] += room[i, j] * part
                lack -= part * free


@nb.njit(cache=True, nogil=True)
def block_mean(image: Array, top: int, left: int, n: int) -> Any:
    """The mean of n x n texels, their four byte floats summed up in OpenCV's order."""
    total = np.float32(0)
    if n == 2:
        total = (image[top, left] + image[top, left + 1]) + (image[top + 1, left] + image[top + 1, left + 1])
    else:
        for y in range(top, top + n):
            for x in range(left, left + n, 4):
                total += ((image[y, x] + image[y, x + 1]) + image[y, x + 2]) + image[y, x + 3]
    return total * np.float32(1 / (n * n))


@nb.njit(cache=True, nogil=True)
def bleed(picture: Array, alpha: Array, label: Array, enough: Any, own: Any, out: Array) -> None:
    """Straight colours of a premultiplied picture (H, W, 4) under another alpha (H, W), into bytes (H, W, 4).

    A texel that is covered less than `own` takes the colour of that texel of the same label (H, W) that is covered
    `enough`; there is one.
    """
    height, width = alpha.shape
    nearest = np.zeros((label.max() + 1, 3), np.float32)
    for row in range(height):
        for x in range(width):
            if picture[row, x, 3] >= enough:
                for k in range(3):
                    nearest[label[row, x], k] = picture[row, x, k] / max(picture[row, x, 3], LITTLE)
    for row in range(height):
        for x in range(width):
            for k in range(3):
                if picture[row, x, 3] >= own:
                    colour = picture[row, x, k] / max(picture[row, x, 3], LITTLE)
                else:
                    colour = nearest[label[row, x], k]
                out[row, x, k] = _byte(colour)
            out[row, x, 3] = _byte(alpha[row, x])


@nb.njit(cache=True, nogil=True)
def _byte(share: Any) -> Any:
    """A share, held to [0, 1], of 255, rounded."""
    return np.uint8(np.rint(min(max(share, np.float32(0)), np.float32(1)) * np.float32(255)))
