"""A picture of a tree's levels of detail: side by side at one size, and each beside the finer one where they switch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.check.lods import DrawnLevel
from forestgen.check.pictures import INK, PAPER, Picture, portrait_picture
from forestgen.render import Studio
from forestgen.render.drawable import extent_along

TALL_PX = 480  # height of the tree in the upper row
FINER = 2  # how much larger a picture is drawn than shown: a pixel is what its footprint sees
MARGIN = 0.05  # of the height, around the tree
CAPTION = 34  # px below a picture
GAP = 6  # px between a finer level and the coarser one
FACE, LETTER = cv2.FONT_HERSHEY_SIMPLEX, 0.45


def lod_sheet(levels: Sequence[DrawnLevel], *, azimuth: float = 0.0) -> Picture:
    """Above, all levels as tall as TALL_PX, with their triangles; below, at each size at which one gives way to
    the next, both of them as they are on the screen. Lit; `azimuth` in radians.

    Raises:
        ValueError: the first level, the full tree, shows nothing.
        RenderError: no OpenGL to render with.
    """
    pairs = [(finer, coarser) for finer, coarser in pairwise(levels) if coarser.n_triangles]
    sizes = [float(min(coarser.switch_px, TALL_PX)) for _, coarser in pairs]
    shown: dict[str, dict[float, Picture]] = {}
    for level in levels:
        wanted = {float(TALL_PX)} | {size for pair, size in zip(pairs, sizes, strict=True) if level in pair}
        with Studio(level.drawables) as studio:
            drawn = studio.lit(_camera(levels, azimuth, TALL_PX))
        shown[level.level] = {size: _portrait(drawn, _camera(levels, azimuth, size)) for size in wanted}
    upper = [_captioned(shown[level.level][float(TALL_PX)], _cost(level)) for level in levels]
    lower = []
    for (finer, coarser), size in zip(pairs, sizes, strict=True):
        left, right = shown[finer.level][size], shown[coarser.level][size]
        between = np.full((len(left), GAP, 3), PAPER, np.uint8)
        words = f"{finer.level} | {coarser.level} at {coarser.switch_px:.0f} px"
        lower.append(_captioned(np.hstack([left, between, right]), words))
    rows = [_row(part) for part in (upper, lower) if part]
    wide = max(row.shape[1] for row in rows)
    return np.vstack([_padded(row, len(row), wide) for row in rows])


def _cost(level: DrawnLevel) -> str:
    leaves = f", {level.n_instances:,} leaves" if level.n_instances else ""
    return f"{level.level}: {level.n_triangles:,} triangles{leaves}"


def _camera(levels: Sequence[DrawnLevel], azimuth: float, tall_px: float) -> Camera:
    """A camera that shows all of every level, the full tree so many px tall, FINER times as large."""
    axes = Camera((1, 1), (0.0, 0.0), 1.0, azimuth).axes[:2]
    extents = np.array([extent_along(level.drawables, axes) for level in levels if level.n_triangles])
    low, high = extent_along(levels[0].drawables, axes[1:])[:, 0]
    scale = tall_px / max(float(high - low), 1e-6)
    room = MARGIN * tall_px
    least, most = extents[:, 0].min(axis=0) * scale, extents[:, 1].max(axis=0) * scale
    width, height = np.ceil(most - least + 2 * room).astype(int).tolist()
    root = (FINER * float(room - least[0]), FINER * float(room + most[1]))
    return Camera((FINER * width, FINER * height), root, FINER * scale, azimuth)


def _portrait(drawn: NDArray[np.float32], camera: Camera) -> Picture:
    """A lit picture (H, W, 4) as seen through a camera of its or a smaller size: each pixel averaged over those
    that were drawn for it."""
    width, height = (side // FINER for side in camera.size)
    rgba = np.asarray(cv2.resize(drawn, (width, height), interpolation=cv2.INTER_AREA), np.float32)
    return portrait_picture(rgba, foot=(camera.root_px[0] / FINER, camera.root_px[1] / FINER))


def _captioned(picture: Picture, words: str) -> Picture:
    """A picture with words below, widened where they need it."""
    needed = math.ceil(cv2.getTextSize(words, FACE, LETTER, 1)[0][0]) + 16
    canvas = _padded(picture, len(picture) + CAPTION, max(picture.shape[1], needed))
    cv2.putText(canvas, words, (8, len(picture) + CAPTION - 12), FACE, LETTER, INK, 1, cv2.LINE_AA)
    return canvas


def _row(parts: Sequence[Picture]) -> Picture:
    """Pictures side by side, standing on one line."""
    tall = max(len(part) for part in parts)
    return np.hstack([_padded(part, tall, part.shape[1] + GAP, from_top=False) for part in parts])


def _padded(picture: Picture, height: int, width: int, *, from_top: bool = True) -> Picture:
    """A picture on paper of that size, at its left, at the top or at the bottom."""
    canvas = np.full((height, width, 3), PAPER, np.uint8)
    top = 0 if from_top else height - len(picture)
    canvas[top : top + len(picture), : picture.shape[1]] = picture
    return canvas
