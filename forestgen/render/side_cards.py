"""Six pictures of a tree for USD's own cards (UsdGeomModelAPI, drawMode "cards"): each fills one face of its box.

USD's documentation does not say how a picture lies on its face; UsdImaging's source does (drawModeStandin.cpp,
read at release 24.08), alike for Y-up and Z-up stages: seen from outside, up is +Z on the faces across X and Y,
+Y on Z's front, and -Y on its back. It also fixes the threshold of their opacity at 0.1, so alpha is either
full or none here: soft edges would show as leaves grown fat.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forestgen.camera import Camera
from forestgen.render.card_cutout import bled, cutout_alpha
from forestgen.render.model_drawables import level_drawables
from forestgen.render.raster import pictures
from forestgen.tree.level import full_level
from forestgen.tree.model import TreeModel

LONGEST = 512  # px along the longest edge of the box
QUARTER = np.pi / 2
FACES = {  # azimuth and elevation of a camera before the face, and quarters by which its picture turns anticlockwise
    "XPos": (QUARTER, 0.0, -1),
    "YPos": (0.0, QUARTER, 2),
    "ZPos": (0.0, 0.0, 0),
    "XNeg": (-QUARTER, 0.0, 1),
    "YNeg": (0.0, -QUARTER, 0),
    "ZNeg": (np.pi, 0.0, 2),
}


def side_cards(
    model: TreeModel, box: ArrayLike, atlases: Sequence[NDArray[np.uint8] | None], *, longest: int = LONGEST
) -> list[dict[str, NDArray[np.uint8]]]:
    """Pictures (H, W, 4), sRGB and straight alpha, of a tree as seen before each face of a box (2, 3) m.

    They lie as USD's card textures do, and reach from edge to edge of the face. One set for each of some leaf
    atlases, which differ in their colours only; without leaves where that is None.

    Raises:
        ValueError: the box has no extent along some axis.
    """
    low, high = np.asarray(box, float)
    extent = high - low
    if not (extent > 0).all():
        raise ValueError(f"side_cards: the box spans {extent.tolist()} m; it needs an extent along each axis")
    px = np.maximum(np.ceil(extent * (longest / extent.max())), 1)
    to_px = np.diag([*(px / extent), 1.0])
    to_px[:3, 3] = -low * px / extent
    drawables = [
        replace(drawable, transforms=to_px @ drawable.transforms)
        for drawable in level_drawables(full_level(model), model.bark, model.atlas.rgba)
    ]
    sets: list[dict[str, NDArray[np.uint8]]] = [{} for _ in atlases]
    for face, (azimuth, elevation, turn) in FACES.items():
        drawn = pictures(drawables, _camera(px, azimuth, elevation), atlases)
        alpha: dict[bool, NDArray[np.float32]] = {}  # of the leafy ones, and of the bare ones
        for found, atlas, picture in zip(sets, atlases, drawn, strict=True):
            is_bare = atlas is None
            if is_bare not in alpha:
                alpha[is_bare] = _sharp_alpha(picture[..., 3])
            found[face] = np.ascontiguousarray(np.rot90(bled(picture, alpha[is_bare]), turn))
    return sets


def _camera(px: NDArray[np.float64], azimuth: float, elevation: float) -> Camera:
    """The camera before one face of the box from the origin to `px` (3,) that sees just that."""
    axes = np.round(Camera((1, 1), (0.0, 0.0), 1.0, azimuth, elevation).axes[:2])
    across, up = axes @ px
    width, height = round(abs(across)), round(abs(up))
    return Camera((width, height), (max(0.0, -across), height - max(0.0, -up)), 1.0, azimuth, elevation)


def _sharp_alpha(coverage: NDArray[np.float32]) -> NDArray[np.float32]:
    """Alpha (H, W) that is 0 or 1 and shows as much as is covered."""
    coverage = np.ascontiguousarray(coverage)
    return (cutout_alpha(coverage, coverage) >= 0.5).astype(np.float32)
