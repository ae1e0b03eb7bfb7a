"""Cells packed into one texture by xatlas, their colours bled under the edges so that mip levels do not fringe."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

GUTTER = 8  # px between cells: three mip levels stay apart
SIDES = (64, 128, 256, 512, 1024, 2048)  # px an atlas may be wide or high
SOLID = 0.9  # alpha from which a texel's colour is the leaf's own


def pack(sizes: Sequence[tuple[int, int]], *, largest: int = SIDES[-1]) -> tuple[tuple[int, int], NDArray[np.int64]]:
    """Place rectangles (width, height) px: the texture's (width, height), and each one's left and top (K, 2).

    Raises:
        ValueError: they do not fit into the largest texture.
    """
    area = sum((w + GUTTER) * (h + GUTTER) for w, h in sizes)
    for side in SIDES:
        if side > largest or side * side < area:
            continue
        corner, height = _pack_into(sizes, side)
        if height <= side:
            return (side, next(s for s in SIDES if s >= height)), corner
    raise ValueError(f"{len(sizes)} cells do not fit into an atlas of {largest} px; make them smaller")


def _pack_into(sizes: Sequence[tuple[int, int]], side: int) -> tuple[NDArray[np.int64], int]:
    """Left and top (K, 2) of rectangles in a texture `side` px wide, and the height that they take."""
    import xatlas

    atlas = xatlas.Atlas()
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    rectangles = [np.array([[0, 0], [w, 0], [w, h], [0, h]], np.float32) for w, h in sizes]  # kept till packed
    for rectangle in rectangles:  # one mesh a rectangle: those that share a corner would merge; xatlas takes no copy
        atlas.add_uv_mesh(rectangle, faces)
    options = xatlas.PackOptions()
    options.resolution, options.padding, options.texels_per_unit = side, GUTTER, 1.0
    options.rotate_charts = options.rotate_charts_to_axis = options.create_image = False
    options.bruteForce = True
    atlas.generate(pack_options=options)
    if atlas.atlas_count != 1:
        return np.zeros((len(sizes), 2), np.int64), SIDES[-1] + 1
    placed = np.array([atlas[k][2].min(axis=0) * [atlas.width, atlas.height] for k in range(len(sizes))])
    found = np.array([np.ptp(atlas[k][2], axis=0) * [atlas.width, atlas.height] for k in range(len(sizes))])
    if not np.allclose(found, sizes, atol=0.51):
        raise ValueError("xatlas turned or scaled a cell")
    corner = np.round(placed - 0.5).astype(np.int64)
    corner = np.maximum(corner, 0)
    return corner, int((corner[:, 1] + np.array(sizes)[:, 1]).max() + GUTTER // 2)


def compose(cells: Sequence[NDArray[np.uint8]], size: tuple[int, int], corner: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Lay RGBA cells (h, w, 4) into one texture (H, W, 4); bleed the colour of solid texels over all others."""
    rgba = np.zeros((size[1], size[0], 4), np.uint8)
    for cell, (left, top) in zip(cells, corner, strict=True):
        rgba[top : top + cell.shape[0], left : left + cell.shape[1]] = cell
    return bleed(rgba)


def bleed(rgba: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Give each texel (H, W, 4) below full alpha the colour of the nearest solid one; alpha stays."""
    solid = rgba[..., 3] >= SOLID * 255
    if not solid.any():
        return rgba
    _, label = cv2.distanceTransformWithLabels(
        (~solid).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    colour = np.zeros((int(label.max()) + 1, 3), np.uint8)
    colour[label[solid]] = rgba[solid][:, :3]
    out = rgba.copy()
    out[..., :3] = colour[label]
    return out
