"""Compiled inner loops of the raster: which face each sample shows, and the colours of what is shown.

The tests run the same functions as plain Python.
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

ACROSS = (0.375, 0.875, 0.125, 0.625)  # where a pixel's samples lie: OpenGL's, so that upright edges have four steps
DOWN = (0.875, 0.625, 0.375, 0.125)
FIRST, LAST = 0.125, 0.875


@nb.njit(cache=True, nogil=True)
def seen(points: Array, places: Array, out: Array) -> None:
    """Points (P, 3) at places (K, 3, 4), one after the other: into `out` (K * P, 3)."""
    for k in range(len(places)):
        for p in range(len(points)):
            x, y, z = points[p, 0], points[p, 1], points[p, 2]
            for i in range(3):
                out[k * len(points) + p, i] = (
                    places[k, i, 0] * x + places[k, i, 1] * y + places[k, i, 2] * z + places[k, i, 3]
                )


@nb.njit(cache=True, nogil=True)
def cover(
    points: Array,
    uv: Array,
    faces: Array,
    alpha: Array,
    threshold: float,
    first: int,
    depth: Array,
    face: Array,
) -> None:
    """Draw faces (F, 3) of points (P, 3), px right, px down and nearness, onto samples (H, W, 4), in place.

    A sample takes a face, and its depth, that is nearer than what it shows, where the texture's alpha (h, w),
    interpolated at the points' uv (P, 2), reaches the threshold; no texels count as opaque. Faces are numbered from
    `first` on.
    """
    height, width = depth.shape[:2]
    for f in range(len(faces)):
        i, j, k = faces[f]
        x0, y0, z0 = points[i, 0], points[i, 1], points[i, 2]
        ax, ay, az = points[j, 0] - x0, points[j, 1] - y0, points[j, 2] - z0
        bx, by, bz = points[k, 0] - x0, points[k, 1] - y0, points[k, 2] - z0
        area = ax * by - bx * ay
        left, right = max(0, int(np.floor(x0 + min(0.0, ax, bx) - LAST))), x0 + max(0.0, ax, bx) - FIRST
        top, bottom = max(0, int(np.floor(y0 + min(0.0, ay, by) - LAST))), y0 + max(0.0, ay, by) - FIRST
        if area == 0.0 or right < left or bottom < top or left >= width or top >= height:
            continue
        one = 1.0 / area
        u0, v0 = uv[i, 0], uv[i, 1]
        au, av, bu, bv = uv[j, 0] - u0, uv[j, 1] - v0, uv[k, 0] - u0, uv[k, 1] - v0
        for row in range(top, min(height, int(bottom) + 1)):
            for column in range(left, min(width, int(right) + 1)):
                for s in range(4):
                    x, y = column + ACROSS[s] - x0, row + DOWN[s] - y0
                    a, b = (x * by - bx * y) * one, (ax * y - x * ay) * one
                    if a < 0.0 or b < 0.0 or a + b > 1.0:
                        continue
                    z = z0 + a * az + b * bz
                    if z <= depth[row, column, s]:
                        continue
                    if alpha.size and interpolated(alpha, u0 + a * au + b * bu, v0 + a * av + b * bv) < threshold:
                        continue
                    depth[row, column, s] = z
                    face[row, column, s] = first + f


@nb.njit(cache=True, nogil=True)
def texels_about(height: int, width: int, u: float, v: float) -> Any:
    """The columns and rows of the four texels about a place of a repeating image, v upward, and where between them."""
    x, y = (u - np.floor(u)) * width - 0.5, (np.ceil(v) - v) * height - 0.5
    left, top = int(np.floor(x)), int(np.floor(y))
    x, y = x - left, y - top
    right, below = left + 1, top + 1
    if left < 0:
        left = width - 1
    if right >= width:
        right = 0
    if top < 0:
        top = height - 1
    if below >= height:
        below = 0
    return left, right, top, below, x, y


@nb.njit(cache=True, nogil=True)
def interpolated(image: Array, u: float, v: float) -> Any:
    """A repeating image (h, w) at a place, v upward."""
    left, right, top, below, x, y = texels_about(image.shape[0], image.shape[1], u, v)
    upper = image[top, left] * (1.0 - x) + image[top, right] * x
    lower = image[below, left] * (1.0 - x) + image[below, right] * x
    return upper * (1.0 - y) + lower * y


@nb.njit(cache=True, nogil=True)
def shade(
    face: Array,
    first: int,
    points: Array,
    uv: Array,
    faces: Array,
    texel: Array,
    start: Array,
    size: Array,
    picture: Array,
) -> None:
    """Add the colours of faces (F, 3), numbered from `first` on, to a premultiplied picture (H, W, 4), in place.

    A face is looked up once a pixel, in the middle of the samples (H, W, 4) that show it, between the two of its
    texture's K levels whose texels are nearest to a pixel's size: `texel` (N, 3), where each level starts (K,), its
    height and width (K, 2).
    """
    height, width = face.shape[:2]
    for row in range(height):
        for column in range(width):
            done = 0
            for s in range(4):
                f = face[row, column, s] - first
                if f < 0 or f >= len(faces) or (done >> s) & 1:
                    continue
                n, x, y = 0, 0.0, 0.0
                for t in range(s, 4):
                    if face[row, column, t] == f + first:
                        done |= 1 << t
                        n, x, y = n + 1, x + ACROSS[t], y + DOWN[t]
                i, j, k = faces[f]
                x, y = column + x / n - points[i, 0], row + y / n - points[i, 1]
                ax, ay = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
                bx, by = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1]
                one = 1.0 / (ax * by - bx * ay)
                u0, v0 = uv[i, 0], uv[i, 1]
                au, av, bu, bv = uv[j, 0] - u0, uv[j, 1] - v0, uv[k, 0] - u0, uv[k, 1] - v0
                a, b = (x * by - bx * y) * one, (ax * y - x * ay) * one
                u, v = u0 + a * au + b * bu, v0 + a * av + b * bv
                right = ((au * by - bu * ay) * one * size[0, 1]) ** 2 + ((av * by - bv * ay) * one * size[0, 0]) ** 2
                down = ((bu * ax - au * bx) * one * size[0, 1]) ** 2 + ((bv * ax - av * bx) * one * size[0, 0]) ** 2
                level = min(max(0.5 * np.log2(max(right, down, 1.0)), 0.0), len(start) - 1.0)
                finer = int(level)
                for coarser in range(2):
                    weight = (level - finer if coarser else 1.0 - (level - finer)) * n / (4 * 255.0)
                    if weight > 0.0:
                        h, w = size[finer + coarser]
                        _add(texel, start[finer + coarser], h, w, u, v, weight, picture[row, column])
                picture[row, column, 3] += n / 4


@nb.njit(cache=True, nogil=True)
def _add(texel: Array, start: int, height: int, width: int, u: float, v: float, weight: float, colour: Array) -> None:
    """Add a level of a repeating texture at a place, v upward, times a weight to a colour (4,)."""
    left, right, top, below, x, y = texels_about(height, width, u, v)
    top, below = start + top * width, start + below * width
    for k in range(3):
        upper = texel[top + left, k] * (1.0 - x) + texel[top + right, k] * x
        lower = texel[below + left, k] * (1.0 - x) + texel[below + right, k] * x
        colour[k] += weight * (upper * (1.0 - y) + lower * y)
