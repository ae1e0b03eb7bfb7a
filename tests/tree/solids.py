"""Solids of known shape, and the views that show their shadows; metres, the root at the origin."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.tree.branches import BranchGraph
from forestgen.tree.density import DensityVolume
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo, load_photo
from forestgen.tree.scale import photo_camera
from forestgen.tree.strokes import Strokes, load_strokes
from forestgen.tree.view import View

Solid = Callable[[NDArray[np.float64]], NDArray[np.bool_]]

SIZE = (160, 170)  # px; the root at (80, 150)
PX = 10.0  # a metre
STEP = 0.085  # m between the points that cast a shadow: less than a pixel


def camera(azimuth_deg: float = 0.0, elevation_deg: float = 0.0, focal_px: float | None = None) -> Camera:
    return Camera(SIZE, (80.0, 150.0), PX, np.deg2rad(azimuth_deg), np.deg2rad(elevation_deg), focal_px)


def ball(middle: tuple[float, float, float], radius: float) -> Solid:
    return lambda p: np.asarray(((p - middle) ** 2).sum(axis=1) <= radius**2)


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Solid:
    return lambda p: np.asarray(((p >= low) & (p <= high)).all(axis=1))


def trunk(top: float, radius: float = 0.25) -> Solid:
    return lambda p: np.asarray((np.hypot(p[:, 0], p[:, 2]) <= radius) & (p[:, 1] >= 0) & (p[:, 1] <= top))


@cache
def lattice() -> NDArray[np.float64]:
    """Points (N, 3) over the space that solids may fill."""
    axis, up = np.arange(-4, 4, STEP), np.arange(STEP / 2, 11, STEP)
    return np.stack(np.meshgrid(axis, up, axis, indexing="ij"), axis=-1).reshape(-1, 3)


def shadow(solid: Solid, seen_by: Camera) -> NDArray[np.bool_]:
    """Pixels (H, W) that a solid within 4 m of the trunk and 11 m of the ground covers."""
    points = lattice()
    column, row = np.floor(seen_by.project(points[solid(points)])).astype(int).T
    inside = (column >= 0) & (row >= 0) & (column < SIZE[0]) & (row < SIZE[1])
    picture = np.zeros(SIZE[::-1], bool)
    picture[row[inside], column[inside]] = True
    return picture


def view_of(coverage: NDArray[np.floating], seen_by: Camera, name: str = "drawn.png") -> View:
    """A view whose foliage is the coverage (H, W) told."""
    row, column = np.nonzero(coverage >= 0.5)
    crown = np.array([[60, 20], [100, 20], [80, 100]])
    if len(row):
        crown = cv2.convexHull(np.column_stack([column, row]).astype(np.int32))[:, 0, :] + 0.5
    stem = np.array([[80.0, 150.0], [80.0, 100.0]])
    photo = Photo(np.zeros((*SIZE[::-1], 3), np.uint8), name)
    mattes = Mattes(coverage.astype(np.float32), np.zeros(SIZE[::-1], np.float32))
    graph = BranchGraph(stem, np.array([-1, 0]), np.array([3.0, 3.0]))
    return View(photo, Strokes(crown, (stem,)), mattes, graph, seen_by)


def views_of(*solids: Solid, cameras: tuple[Camera, ...] = (camera(), camera(90))) -> list[View]:
    """What cameras see of solids put together."""
    return [view_of(np.any([shadow(s, c) for s in solids], axis=0), c, f"view_{k}.png") for k, c in enumerate(cameras)]


def volume_iou(volume: DensityVolume, *solids: Solid) -> float:
    """Shared volume over joint volume of the filled voxels and solids."""
    truth = np.any([solid(volume.centres()) for solid in solids], axis=0)
    filled = volume.is_filled.ravel()
    return float((truth & filled).sum() / (truth | filled).sum())


def drawn(volume: DensityVolume, seen_by: Camera) -> NDArray[np.bool_]:
    """Pixels (H, W) that the filled voxels cover."""
    half = 0.5 * volume.edge * seen_by.px_per_metre * np.abs(seen_by.axes[:2]).sum(axis=1)
    xy = seen_by.project(volume.centres(volume.is_filled))
    left, top = np.clip(np.rint(xy - half), 0, seen_by.size).astype(int).T
    right, bottom = np.clip(np.rint(xy + half), 0, seen_by.size).astype(int).T
    steps = np.zeros((seen_by.size[1] + 1, seen_by.size[0] + 1), int)
    for row, column, step in ((top, left, 1), (top, right, -1), (bottom, left, -1), (bottom, right, 1)):
        np.add.at(steps, (row, column), step)
    return np.asarray(steps.cumsum(axis=0).cumsum(axis=1)[:-1, :-1] > 0)


def true_views(folder: Path) -> list[View]:
    """Views of a ground-truth tree with the true masks as mattes."""
    height = json.loads((folder / "truth.json").read_text())["height_m"]
    views = []
    for azimuth in (0, 90):
        photo = load_photo(folder / f"photo_az{azimuth:03d}.jpg")
        strokes = load_strokes(folder / f"strokes_az{azimuth:03d}.json", photo.size)
        true = cv2.imread(str(folder / f"photo_az{azimuth:03d}_mask.png")).astype(np.float32) / np.float32(255)
        mattes = Mattes(true[..., 2], true[..., 1])
        graph = BranchGraph(strokes.branches[0][:2], np.array([-1, 0]), np.ones(2))
        views.append(
            View(photo, strokes, mattes, graph, photo_camera(mattes, strokes, height, azimuth=np.deg2rad(azimuth)))
        )
    return views
