"""Drawn trees in several views, and what tests ask of a skeleton."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.skeleton import Skeleton, n_children
from forestgen.tree.strokes import Strokes
from forestgen.tree.view import View
from tests.synthetic import draw_discs, draw_wood

#   3     4    a fork in space: one limb to the front left, one to the back right, leaves at both ends
#    \   /
#      2
#      1
#      0
FORK = Skeleton(
    np.array([[0, 0, 0], [0, 1.0, 0], [0.05, 2.0, 0.05], [-1.2, 4.0, 1.0], [1.3, 3.8, -0.9]]),
    np.array([-1, 0, 1, 2, 2]),
    np.array([0.15, 0.14, 0.12, 0.05, 0.05]),
)
HEIGHT = 4.6


def fork_view(azimuth_deg: float = 0.0, *, leaves: bool = True, focal_px: float | None = None) -> View:
    """The fork seen from one side, 60 px a metre, its mattes drawn, its graph the true one."""
    size = (300, 320)
    camera = Camera(size, (150.0, 300.0), 60.0, azimuth=np.deg2rad(azimuth_deg), focal_px=focal_px)
    xy = camera.project(FORK.position)
    wood = draw_wood(xy, FORK.parent, FORK.radius * 60, size)
    balls = draw_discs(camera.project(FORK.position[3:]), np.full(2, 0.6 * 60), size) if leaves else 0 * wood
    outline = np.array([[10.0, 10], [290, 10], [290, 220], [10, 220]])
    strokes = Strokes(outline, (xy[[0, 1, 2]],), size=size)
    graph = BranchGraph(xy, FORK.parent, FORK.radius * 60)
    mattes = Mattes(balls.astype(np.float32), (wood * (1 - balls)).astype(np.float32))
    return View(
        Photo(np.zeros((*size[::-1], 3), np.uint8), f"fork_{azimuth_deg:.0f}.png"), strokes, mattes, graph, camera
    )


def without_graph(view: View) -> View:
    """The view with nothing traced but the root."""
    graph = BranchGraph(view.branches.xy[:1], view.branches.parent[:1], np.array([np.nan]))
    return replace(view, branches=graph)


def tips(skeleton: Skeleton) -> NDArray[np.float64]:
    return np.asarray(skeleton.position[n_children(skeleton.parent) == 0])


def distance_to(skeleton: Skeleton, point: NDArray[np.float64]) -> float:
    """Metres from a point (3,) to the nearest edge of a skeleton."""
    a, b = skeleton.position[skeleton.parent[1:]], skeleton.position[1:]
    way = b - a
    t = np.clip(np.sum((point - a) * way, axis=1) / np.maximum(np.sum(way**2, axis=1), 1e-12), 0, 1)
    return float(np.linalg.norm(a + t[:, None] * way - point, axis=1).min())
