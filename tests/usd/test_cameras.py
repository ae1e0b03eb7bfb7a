"""Cameras: USD's own frustum sees what Camera.project says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom

from forestgen.camera import Camera
from forestgen.usd.cameras import write_cameras
from tests.usd.models import tree_model, view

PX = 1e-3  # what float32 apertures leave of exactness, at photo sizes
CAMERAS = {
    "front": Camera((1500, 1125), (700.25, 1050.5), 93.7),
    "root outside the frame": Camera((640, 480), (-35.0, 611.0), 40.0, np.radians(90)),
    "from above, turned": Camera((480, 640), (200.0, 630.0), 61.0, np.radians(-150), np.radians(35)),
    "perspective": Camera((1500, 2000), (810.0, 1900.0), 140.0, np.radians(20), np.radians(-8), focal_px=1800.0),
    "wide": Camera((900, 300), (100.0, 290.0), 21.0, np.radians(200), np.radians(3), focal_px=400.0),
}


def through_usd(camera: Gf.Camera, size: tuple[int, int], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels (N, 2) of points (N, 3) by USD's view and projection matrices."""
    frustum = camera.frustum
    matrix = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
    ndc = np.array([matrix.Transform(Gf.Vec3d(*point)) for point in points])
    return (ndc[:, :2] * [1, -1] + 1) / 2 * size


@pytest.mark.parametrize("name", CAMERAS)
def test_usd_projects_as_the_camera_does(tmp_path: Path, name: str) -> None:
    camera = CAMERAS[name]
    model = tree_model(n_leaves=0)
    path = write_cameras(type(model)(**{**vars(model), "views": (view(camera),)}), tmp_path / "oak")
    stage = Usd.Stage.Open(str(path))
    written = UsdGeom.Camera(stage.GetPrimAtPath("/oak/cameras/view_00")).GetCamera(Usd.TimeCode.Default())
    points = np.random.default_rng(1).uniform([-2, 0, -2], [2, 6, 2], (200, 3))
    assert_allclose(through_usd(written, camera.size, points), camera.project(points), atol=PX)
    near, far = written.clippingRange.min, written.clippingRange.max
    depth = -np.array([written.frustum.ComputeViewMatrix().Transform(Gf.Vec3d(*p))[2] for p in points])
    assert depth.min() > near
    assert depth.max() < far


def test_apertures_are_in_tenths_of_a_metre(tmp_path: Path) -> None:
    path = write_cameras(tree_model(), tmp_path / "oak")
    stage = Usd.Stage.Open(str(path))
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/oak/cameras/view_00"))
    assert camera.GetProjectionAttr().Get() == "orthographic"
    assert camera.GetHorizontalApertureAttr().Get() == pytest.approx(60 / 18 * 10)
    assert camera.GetVerticalApertureAttr().Get() == pytest.approx(80 / 18 * 10)
    lens = UsdGeom.Camera(stage.GetPrimAtPath("/oak/cameras/view_02"))
    assert lens.GetProjectionAttr().Get() == "perspective"
    assert lens.GetFocalLengthAttr().Get() == pytest.approx(140 / 90 * 0.36)


def test_there_is_one_camera_a_view_and_nothing_else(tmp_path: Path) -> None:
    stage = Usd.Stage.Open(str(write_cameras(tree_model(), tmp_path / "oak")))
    assert stage.GetDefaultPrim().GetPath() == "/oak"
    names = [prim.GetName() for prim in stage.GetPrimAtPath("/oak/cameras").GetChildren()]
    assert names == ["view_00", "view_01", "view_02"]


def test_in_the_scene_the_camera_stands_where_its_tree_stands(scene: Path) -> None:
    stage = Usd.Stage.Open(str(scene))
    camera = tree_model().views[1].camera
    prim = stage.GetPrimAtPath("/wood/cameras/bare/cameras/view_01")
    written = UsdGeom.Camera(prim).GetCamera(Usd.TimeCode.Default())
    tree = UsdGeom.Xformable(stage.GetPrimAtPath("/wood/trees/bare")).ComputeLocalToWorldTransform(0)
    points = np.random.default_rng(1).uniform([-1, 0, -1], [1, 3, 1], (50, 3))
    placed = np.array([tree.Transform(Gf.Vec3d(*point)) for point in points])
    assert_allclose(through_usd(written, camera.size, placed), camera.project(points), atol=PX)
