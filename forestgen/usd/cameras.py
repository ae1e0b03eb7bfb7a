"""The photos' cameras as UsdGeomCameras, in a layer that a scene references beside the tree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom

from forestgen.camera import Camera
from forestgen.tree.model import TreeModel
from forestgen.usd.geometry import place
from forestgen.usd.layers import new_stage, require_prim_name, save

TENTH = 0.1  # apertures and focal lengths are in tenths of a scene unit
FILM_WIDTH = 0.036  # m; a full-frame sensor, so that a perspective camera's focal length reads as in photography
STAND_OFF = 4.0  # tree heights between the root and an orthographic camera, which could stand anywhere


def write_cameras(model: TreeModel, folder: Path) -> Path:
    """Write `cameras.usda` with `/<folder's name>/cameras/view_NN` for each view; give its path.

    Raises:
        ValueError: the folder's name is no prim name; nothing is written.
        OSError: the layer could not be written.
    """
    require_prim_name(folder.name)
    stage = new_stage(folder.name)
    tree = UsdGeom.Xform.Define(stage, f"/{folder.name}").GetPath()
    home = UsdGeom.Scope.Define(stage, tree.AppendChild("cameras")).GetPath()
    for k, view in enumerate(model.views):
        define_camera(stage, home.AppendChild(f"view_{k:02d}"), view.camera, STAND_OFF * model.height)
    folder.mkdir(parents=True, exist_ok=True)
    return save(stage.GetRootLayer(), folder / "cameras.usda")


def define_camera(stage: Usd.Stage, path: Sdf.Path, camera: Camera, stand_off: float) -> None:
    """Author a camera that sees what `camera.project` says.

    `stand_off` is the distance from the root's plane, in metres, of an orthographic one. The root
    lies where it does in the photo because the camera is shifted within its plane, not its film:
    aperture offsets are ignored by some readers.
    """
    is_orthographic = camera.focal_px is None
    distance = stand_off if is_orthographic else camera.distance
    width, height = np.array(camera.size) / camera.px_per_metre  # m at the root's plane
    shrink = 1.0 if is_orthographic else FILM_WIDTH / width  # from the root's plane onto the film

    prim = UsdGeom.Camera.Define(stage, path)
    prim.CreateProjectionAttr(UsdGeom.Tokens.orthographic if is_orthographic else UsdGeom.Tokens.perspective)
    prim.CreateHorizontalApertureAttr(float(width * shrink / TENTH))
    prim.CreateVerticalApertureAttr(float(height * shrink / TENTH))
    if not is_orthographic:
        prim.CreateFocalLengthAttr(float(distance * shrink / TENTH))
    prim.CreateClippingRangeAttr(Gf.Vec2f(0.01 * distance, 100.0 * distance))
    prim.CreateFocusDistanceAttr(float(distance))
    place(prim.GetPrim(), camera_pose(camera, distance))
    prim.GetPrim().SetCustomData({"forestgen": {"size_px": Gf.Vec2i(*camera.size)}})


def camera_pose(camera: Camera, distance: float) -> NDArray[np.float64]:
    """From the camera's space (X right, Y up, looking along -Z) to the tree's: (4, 4) for column vectors."""
    aside = (np.array(camera.size) / 2 - camera.root_px) * [1.0, -1.0] / camera.px_per_metre
    pose = np.eye(4)
    pose[:3, :3] = camera.axes.T
    pose[:3, 3] = np.array([*aside, distance]) @ camera.axes
    return pose + 0.0  # no -0 in the text
