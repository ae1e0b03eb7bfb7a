"""Crowns whose shape is known: drawn mattes, their view, and a visible trunk with two limbs."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strokes import Strokes
from forestgen.tree.view import View

SIZE = (300, 340)  # px; 30 px a metre, the root at (150, 320): the tree is 10 m tall
PX = 30.0
ROOT = (150.0, 320.0)


def view_of(foliage: NDArray[np.uint8], wood: NDArray[np.uint8], azimuth: float = 0.0) -> View:
    """A view of drawn mattes, 0 or 1."""
    outline, _ = cv2.findContours(foliage | wood, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    crown = max(outline, key=len)[:, 0, :].astype(float) + 0.5
    trunk = np.array([ROOT, (150.0, 110.0)])
    graph = BranchGraph(trunk, np.array([-1, 0]), np.array([4.0, 4.0]))
    photo = Photo(np.zeros((*SIZE[::-1], 3), np.uint8), "drawn.png")
    mattes = Mattes(foliage.astype(np.float32), wood.astype(np.float32))
    return View(photo, Strokes(crown, (trunk,)), mattes, graph, Camera(SIZE, ROOT, PX, azimuth))


def trunk_matte() -> NDArray[np.uint8]:
    return cv2.rectangle(np.zeros(SIZE[::-1], np.uint8), (146, 160), (154, 319), 1, -1)


def ball_view(azimuth: float = 0.0) -> View:
    """A ball of leaves 6 m wide, its middle 7 m up, on a bare trunk."""
    leaves = cv2.circle(np.zeros(SIZE[::-1], np.uint8), (150, 110), 90, 1, -1)
    return view_of(leaves, trunk_matte(), azimuth)


def cone_view() -> View:
    """A slender cone of leaves, 4 m wide below, 8 m tall."""
    leaves = np.zeros(SIZE[::-1], np.uint8)
    cv2.fillPoly(leaves, [np.array([[150, 20], [90, 260], [210, 260]])], 1)
    return view_of(leaves, trunk_matte())


def two_limbs(top: float = 7.0) -> Skeleton:
    """A trunk of that height, m, and two limbs that the photo shows."""
    trunk = np.column_stack([np.zeros(8), np.linspace(0, top, 8), np.zeros(8)])
    left = np.array([[-0.8, 5.6, 0.1], [-1.6, 6.4, 0.3], [-2.0, 7.4, 0.4]]) * [1, top / 7, 1]
    right = np.array([[0.7, 6.7, 0.0], [1.4, 7.6, -0.3]]) * [1, top / 7, 1]
    parent = [-1, *range(7), 4, 8, 9, 5, 11]
    radius = np.full(13, np.nan)
    radius[:8] = np.linspace(0.15, 0.06, 8)
    return Skeleton(np.concatenate([trunk, left, right]), np.array(parent), radius)
