"""Six pictures of a tree for USD's own cards (UsdGeomModelAPI, drawMode "cards"): each fills one face of its box.

USD's documentation does not say how a picture lies on its face; UsdImaging's source does (drawModeStandin.cpp,
read at release 24.08), alike for Y-up and Z-up stages: seen from outside, up is +Z on the faces across X and Y,
+Y on Z's front, and -Y on its back. It also fixes the threshold of their opacity at 0.1, so alpha is either
full or none here: soft edges would show as leaves grown fat.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forestgen.camera import Camera
from forestgen.render.card_cutout import bled, cutout_alpha
from forestgen.render.model_drawables import level_drawables
from forestgen.render.studio import Studio
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
    model: TreeModel, box: ArrayLike, *, leaf_rgba: NDArray[np.uint8] | None = None, longest: int = LONGEST
) -> dict[str, NDArray[np.uint8]]:
    """Pictures (H, W, 4), sRGB and straight alpha, of a tree as seen before each face of a box (2, 3) m.

    They lie as USD's card textures do, and reach from edge to edge of the face. `leaf_rgba` is the atlas in
    another season's colours, the tree's own where it is None; a tree in winter is one with NO_LEAVES.

    Raises:
        ValueError: the box has no extent along some axis.
        RenderError: there is no OpenGL to draw with.
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
        for drawable in level_drawables(
            full_level(model), model.bark, model.atlas.rgba if leaf_rgba is None else leaf_rgba
        )
    ]
    with Studio(drawables) as studio:
        return {name: _picture(studio, px, *face) for name, face in FACES.items()}


def _picture(studio: Studio, px: NDArray[np.float64], azimuth: float, elevation: float, turn: int) -> NDArray[np.uint8]:
    """What a camera before one face of the box from the origin to `px` (3,) sees of all that is in it."""
    axes = np.round(Camera((1, 1), (0.0, 0.0), 1.0, azimuth, elevation).axes[:2])
    across, up = axes @ px
    width, height = round(abs(across)), round(abs(up))
    root = (max(0.0, -across), height - max(0.0, -up))
    picture = studio.colour(Camera((width, height), root, 1.0, azimuth, elevation))
    coverage = np.ascontiguousarray(picture[..., 3])
    alpha = (cutout_alpha(coverage, coverage) >= 0.5).astype(np.float32)
    return np.ascontiguousarray(np.rot90(bled(picture, alpha), turn))
