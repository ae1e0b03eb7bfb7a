"""The scene: trees stand where the forest says, as instances of their components."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from forestgen.usd.forest_scene import write_forest
from tests.usd.conftest import FOREST


def test_kinds_form_an_unbroken_hierarchy(scene: Path) -> None:
    stage = Usd.Stage.Open(str(scene))
    kinds = {str(prim.GetPath()): Usd.ModelAPI(prim).GetKind() for prim in stage.Traverse()}
    assert {path: kind for path, kind in kinds.items() if kind} == {
        "/wood": "assembly",
        "/wood/trees": "group",
        "/wood/trees/oak": "component",
        "/wood/trees/bare": "component",
        "/wood/trees/oak_copy": "component",
        "/wood/ground": "component",
    }
    assert stage.GetDefaultPrim().GetPath() == "/wood"
    assert all(stage.GetPrimAtPath(path).IsModel() for path, kind in kinds.items() if kind)


def test_trees_are_instances_and_stand_where_they_should(scene: Path) -> None:
    stage = Usd.Stage.Open(str(scene))
    assert len(stage.GetPrototypes()) == 2
    for k, name in enumerate(FOREST.names):
        prim = stage.GetPrimAtPath(f"/wood/trees/{name}")
        assert prim.IsInstance()
        place = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
        c, s = np.cos(FOREST.yaw[k]), np.sin(FOREST.yaw[k])
        # anticlockwise seen from above: +Z turns towards +X
        for point, turned in (((0, 0, 1), (s, 0, c)), ((1, 0, 0), (c, 0, -s)), ((0, 2, 0), (0, 2, 0))):
            expected = FOREST.position[k] + FOREST.scale[k] * np.array(turned)
            assert_allclose(place.Transform(Gf.Vec3d(*point)), expected, atol=1e-6)


def test_references_are_relative_and_go_to_the_layers_once_written(scene: Path) -> None:
    layer = Sdf.Layer.FindOrOpen(str(scene))
    assert set(layer.GetCompositionAssetDependencies()) == {
        "./trees/oak/oak.usda",
        "./trees/bare/bare.usda",
        "./trees/oak/cameras.usda",
        "./trees/bare/cameras.usda",
    }
    assert str(scene.parent) not in scene.read_text()


def test_assets_beside_the_scene_folder_are_reached_upwards(scene: Path, tmp_path: Path) -> None:
    trees = scene.parent / "trees"
    assets = {name: trees / name / f"{name}.usda" for name in FOREST.prototypes}
    (trees / "set").mkdir(exist_ok=True)
    path = write_forest(FOREST, assets, {}, trees / "set" / "wood.usda", "wood")
    assert "@../oak/oak.usda@" in path.read_text()
    stage = Usd.Stage.Open(str(path))
    assert not stage.GetCompositionErrors()
    assert not stage.GetPrimAtPath("/wood/cameras")


def test_ground_lies_under_every_crown(scene: Path) -> None:
    stage = Usd.Stage.Open(str(scene))
    boxes = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
    ground = boxes.ComputeWorldBound(stage.GetPrimAtPath("/wood/ground")).ComputeAlignedRange()
    trees = boxes.ComputeWorldBound(stage.GetPrimAtPath("/wood/trees")).ComputeAlignedRange()
    assert ground.GetMin()[1] == ground.GetMax()[1] == FOREST.position[:, 1].min()
    for axis in (0, 2):
        assert ground.GetMin()[axis] < trees.GetMin()[axis] - 1
        assert ground.GetMax()[axis] > trees.GetMax()[axis] + 1
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/wood/ground/geo/plane"))
    assert_allclose(mesh.GetNormalsAttr().Get()[0], [0, 1, 0])
    a, b, c = (np.array(mesh.GetPointsAttr().Get()[k]) for k in mesh.GetFaceVertexIndicesAttr().Get()[:3])
    assert np.cross(b - a, c - a)[1] > 0  # its face looks up


def test_the_sun_shines_down(scene: Path) -> None:
    stage = Usd.Stage.Open(str(scene))
    sun = UsdLux.DistantLight(stage.GetPrimAtPath("/wood/lights/sun"))
    place = UsdGeom.Xformable(sun).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
    beam = place.TransformDir(Gf.Vec3d(0, 0, -1))  # a distant light shines along its -Z
    assert beam[1] < -0.5
    assert beam[2] < 0  # from the photo's side: crowns are not shown against the light


def test_bad_forests_leave_no_file(scene: Path, tmp_path: Path) -> None:
    assets = {name: scene.parent / "trees" / name / f"{name}.usda" for name in FOREST.prototypes}
    path = tmp_path / "wood.usda"
    with pytest.raises(ValueError, match="no asset was written for bare"):
        write_forest(FOREST, {"oak": assets["oak"]}, {}, path, "wood")
    with pytest.raises(ValueError, match="'old oak' is no prim name"):
        write_forest(replace(FOREST, names=("old oak", "b", "c")), assets, {}, path, "wood")
    with pytest.raises(OSError, match="could not be read"):
        write_forest(FOREST, {**assets, "oak": tmp_path / "none.usda"}, {}, path, "wood")
    assert not list(tmp_path.iterdir())


def test_an_empty_forest_is_a_scene_with_ground(tmp_path: Path) -> None:
    empty = replace(
        FOREST,
        prototypes=(),
        names=(),
        prototype=np.zeros(0, int),
        position=np.zeros((0, 3)),
        yaw=np.zeros(0),
        scale=np.zeros(0),
    )
    stage = Usd.Stage.Open(str(write_forest(empty, {}, {}, tmp_path / "wood.usda", "wood")))
    assert stage.GetPrimAtPath("/wood/ground/geo/plane")
    assert not stage.GetPrimAtPath("/wood/trees").GetChildren()
