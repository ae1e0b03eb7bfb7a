"""The scale of a photo: its camera follows from the tree's height, its root and its own matte."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.errors import StageError
from forestgen.tree.mattes import Mattes
from forestgen.tree.strokes import Strokes, draw_polyline, fill_outline

LINK = 0.02  # parts nearer than this share of the tree's height count as connected: the gap an envelope closes


def disc(radius_px: float) -> NDArray[np.uint8]:
    """A structuring element (2r+1, 2r+1) that is a disc; at least 3 x 3."""
    r = max(1, round(radius_px))
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * r + 1, 2 * r + 1)))


def own_part(is_tree: NDArray[np.bool_], strokes: Strokes) -> NDArray[np.bool_]:
    """The connected part (H, W) of a mask that the strokes touch.

    Leaves are islands in a matte, so parts count as connected across gaps of up to 2 % of the
    strokes' height; what the crown outline encloses touches it.
    """
    size = is_tree.shape[::-1]
    tall = np.ptp(np.concatenate([strokes.crown, *strokes.branches])[:, 1])
    touched = fill_outline(strokes.crown, size)
    for path in strokes.branches:
        touched |= draw_polyline(path, size)
    linked = cv2.dilate(is_tree.astype(np.uint8), disc(LINK * tall / 2))
    _, label = cv2.connectedComponents(linked)
    own = np.unique(label[touched & (linked > 0)])
    return np.asarray(is_tree & np.isin(label, own[own > 0]))


def photo_camera(
    mattes: Mattes,
    strokes: Strokes,
    height: float,
    *,
    azimuth: float = 0.0,
    elevation: float = 0.0,
    scale: float = 1.0,
    root: tuple[float, float] | None = None,
    focal_px: float | None = None,
) -> Camera:
    """The camera of a photo of a tree `height` metres tall. Angles in radians.

    Pixels per metre = (root row - top row) / height, where top is the highest row of the tree's
    own matte; `scale` is the user's factor on it.

    Raises:
        StageError: no part of the matte lies above the root.
    """
    foot = strokes.root if root is None else np.asarray(root, float)
    rows = np.flatnonzero(own_part(mattes.is_tree, strokes).any(axis=1))
    if not len(rows) or not rows[0] < foot[1]:
        raise StageError("nothing of the tree was found above its root: draw the trunk from the ground upward")
    height_px = foot[1] - rows[0]
    camera = Camera(
        size=(mattes.foliage.shape[1], mattes.foliage.shape[0]),
        root_px=(float(foot[0]), float(foot[1])),
        px_per_metre=float(height_px / height * scale),
        azimuth=azimuth,
        elevation=elevation,
    )
    return camera if focal_px is None else replace(camera, focal_px=focal_px)
