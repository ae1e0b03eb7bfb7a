"""Matting Laplacian of a picture (Levin et al. 2008, eq. 12), as affinities to the neighbours of each pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

Flat = NDArray[np.float64]  # (n,) one number a pixel of the padded grid, row by row


@dataclass(frozen=True, eq=False)
class MattingLaplacian:
    """L = D - A of a picture (h, w), windows of (2 r + 1)^2 pixels.

    The grid is padded by 2 r pixels on top, at the bottom and on the right, so that every neighbour
    of a pixel has a place: n = (h + 4 r) (w + 2 r) places, the padding's affinities are 0.
    """

    affinity: NDArray[np.float64]  # (n, m) A_ij to the m = 2 r (4 r + 2) neighbours that come after i
    offset: NDArray[np.int64]  # (m,) j - i of these
    degree: Flat  # (n,) D_ii = sum_j A_ij, j = i included: the number of windows that hold the pixel
    shape: tuple[int, int]  # (h, w)
    radius: int

    def pad(self, values: NDArray[Any]) -> NDArray[Any]:
        """A picture (h, w) as places (n,) of the padded grid, 0 in the padding."""
        edge = 2 * self.radius
        return np.pad(values, ((edge, edge), (0, edge))).ravel()

    def crop(self, values: NDArray[Any]) -> NDArray[Any]:
        """Places (n,) of the padded grid as a picture (h, w)."""
        (h, w), edge = self.shape, 2 * self.radius
        return values.reshape(h + 2 * edge, w + edge)[edge : edge + h, :w]

    def times(self, alpha: Flat, at: NDArray[np.int64]) -> Flat:
        """(L alpha) at the places `at` (k,)."""
        return np.asarray(_times(self.affinity, self.offset, alpha, at))

    def diagonal(self, at: NDArray[np.int64]) -> Flat:
        """L_ii at the places `at` (k,)."""
        return np.asarray(_diagonal(self.affinity, self.offset, at))


def half_stencil(reach: int, wide: int) -> NDArray[np.int64]:
    """Steps (m,) to the neighbours within `reach` that come after a place, on a grid so wide."""
    step = np.arange(-reach, reach + 1)
    dy, dx = (axis.ravel() for axis in np.meshgrid(step, step, indexing="ij"))
    return np.asarray((dy * wide + dx)[(dy > 0) | ((dy == 0) & (dx > 0))])


def matting_laplacian(rgb: NDArray[np.floating], radius: int, epsilon: float) -> MattingLaplacian:
    """The matting Laplacian of a picture (h, w, 3) in [0, 1].

    Raises:
        ValueError: the picture is smaller than a window.
    """
    h, w, _ = rgb.shape
    side = 2 * radius + 1
    if min(h, w) < side:
        raise ValueError(f"the picture has {w} x {h} pixels; a window of {side} x {side} does not fit")
    edge = 2 * radius
    offset = half_stencil(edge, w + edge)
    affinity = np.zeros(((h + 2 * edge) * (w + edge), len(offset)))
    _add_windows(np.ascontiguousarray(rgb, np.float64), radius, epsilon, affinity)
    windows = [
        np.minimum(np.minimum(np.arange(n) + 1, side), np.minimum(n - np.arange(n), n - side + 1)) for n in (h, w)
    ]
    degree = np.pad(np.outer(*windows).astype(np.float64), ((edge, edge), (0, edge))).ravel()
    return MattingLaplacian(affinity, offset, degree, (h, w), radius)


@nb.njit(cache=True)
def _add_windows(rgb: NDArray[Any], radius: int, epsilon: float, affinity: NDArray[Any]) -> None:
    """Add (1 + c_i^T (S + epsilon / |w| I)^-1 c_j) / |w| of every window w and pair i before j in it.

    c are the window's colours less their mean, S their covariance.
    """
    h, w, _ = rgb.shape
    side = 2 * radius + 1
    area = side * side
    wide = w + 2 * radius
    c = np.empty((area, 3))
    away = np.empty((area, 3))
    slot = np.empty((area, area), np.int64)
    place = np.empty(area, np.int64)
    for i in range(area):
        place[i] = (i // side) * wide + i % side
        for j in range(i + 1, area):
            dy, dx = j // side - i // side, j % side - i % side
            slot[i, j] = dx - 1 if dy == 0 else 2 * radius + (dy - 1) * (4 * radius + 1) + dx + 2 * radius
    for y in range(h - side + 1):
        for x in range(w - side + 1):
            first = (y + 2 * radius) * wide + x
            for k in range(3):
                total = 0.0
                for i in range(area):
                    c[i, k] = rgb[y + i // side, x + i % side, k]
                    total += c[i, k]
                for i in range(area):
                    c[i, k] -= total / area
            s00 = s11 = s22 = epsilon
            s01 = s02 = s12 = 0.0
            for i in range(area):
                s00 += c[i, 0] * c[i, 0]
                s01 += c[i, 0] * c[i, 1]
                s02 += c[i, 0] * c[i, 2]
                s11 += c[i, 1] * c[i, 1]
                s12 += c[i, 1] * c[i, 2]
                s22 += c[i, 2] * c[i, 2]
            m00, m01, m02 = s11 * s22 - s12 * s12, s02 * s12 - s01 * s22, s01 * s12 - s02 * s11
            m11, m12, m22 = s00 * s22 - s02 * s02, s01 * s02 - s00 * s12, s00 * s11 - s01 * s01
            by = 1.0 / (s00 * m00 + s01 * m01 + s02 * m02)  # of S area, so that 1 / area is already in it
            for i in range(area):
                away[i, 0] = by * (m00 * c[i, 0] + m01 * c[i, 1] + m02 * c[i, 2])
                away[i, 1] = by * (m01 * c[i, 0] + m11 * c[i, 1] + m12 * c[i, 2])
                away[i, 2] = by * (m02 * c[i, 0] + m12 * c[i, 1] + m22 * c[i, 2])
            for i in range(area):
                for j in range(i + 1, area):
                    value = 1.0 / area + away[i, 0] * c[j, 0] + away[i, 1] * c[j, 1] + away[i, 2] * c[j, 2]
                    affinity[first + place[i], slot[i, j]] += value


@nb.njit(cache=True)
def _times(affinity: NDArray[Any], offset: NDArray[Any], alpha: NDArray[Any], at: NDArray[Any]) -> NDArray[Any]:
    """sum_j A_ij (alpha_i - alpha_j): rows that sum to 0 exactly, however small the eigenvalue that matters."""
    out = np.empty(len(at))
    for k in range(len(at)):
        i = at[k]
        here = alpha[i]
        total = 0.0
        for m in range(len(offset)):
            step = offset[m]
            total += affinity[i, m] * (here - alpha[i + step])
            total += affinity[i - step, m] * (here - alpha[i - step])
        out[k] = total
    return out


@nb.njit(cache=True)
def _diagonal(affinity: NDArray[Any], offset: NDArray[Any], at: NDArray[Any]) -> NDArray[Any]:
    out = np.empty(len(at))
    for k in range(len(at)):
        i = at[k]
        total = 0.0
        for m in range(len(offset)):
            total += affinity[i, m] + affinity[i - offset[m], m]
        out[k] = total
    return out
