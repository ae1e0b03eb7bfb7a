"""The scene: trees stand where the forest says, as instances of their components."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from forestgen.scene.forest import Forest
from forestgen.usd.forest_scene import MANY, write_forest
from forestgen.usd.read import read_drawables
from forestgen.usd.standing_trees import NAMES, forest_box
from forestgen.usd.validate import validate_file
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


@pytest.fixture(scope="module")
def assets(scene: Path) -> dict[str, Path]:
    """The written components of the scene."""
    return {name: scene.parent / "trees" / name / f"{name}.usda" for name in FOREST.prototypes}


@pytest.fixture(scope="module")
def points(scene: Path, assets: dict[str, Path]) -> Path:
    """The scene again, its trees as an instancer."""
    return write_forest(FOREST, assets, {}, scene.with_name("points.usda"), "points", instancing="points")


def many(count: int) -> Forest:
    """A forest of one tree, standing at `count` places."""
    rng = np.random.default_rng(3)
    return Forest(
        prototypes=("oak",),
        names=tuple(f"tree_{k}" for k in range(count)),
        prototype=np.zeros(count, int),
        position=rng.uniform(-99, 99, (count, 3)),
        yaw=rng.uniform(-9, 9, count),
        scale=rng.uniform(0.5, 2, count),
    )


def test_an_instancer_shows_the_same_trees(scene: Path, points: Path) -> None:
    native, instanced = read_drawables(scene, "/wood/trees"), read_drawables(points, "/points/trees")
    assert len(native) == len(instanced) == 5  # wood of both trees, three leaf prototypes of one
    for one, other in zip(native, instanced, strict=True):
        assert one.name.removeprefix("/wood/trees") == other.name.removeprefix("/points/trees/Prototypes")
        assert one.points.tobytes() == other.points.tobytes()
        places = [np.asarray(each.transforms).reshape(-1, 16) for each in (one, other)]
        a, b = (rows[np.lexsort(rows.round(3).T)] for rows in places)
        assert_allclose(a, b, atol=2e-6)


def test_an_instancer_is_a_group_of_plain_references(points: Path) -> None:
    stage = Usd.Stage.Open(str(points))
    kinds = {str(prim.GetPath()): Usd.ModelAPI(prim).GetKind() for prim in stage.Traverse()}
    assert {path: kind for path, kind in kinds.items() if kind} == {
        "/points": "assembly",
        "/points/trees": "group",
        "/points/trees/Prototypes": "group",
        "/points/trees/Prototypes/oak": "component",
        "/points/trees/Prototypes/bare": "component",
        "/points/ground": "component",
    }
    trees = UsdGeom.PointInstancer(stage.GetPrimAtPath("/points/trees"))
    assert not any(prim.IsInstance() for prim in stage.Traverse())
    assert trees.GetPrim().HasPayload()
    assert tuple(trees.GetPrim().GetAttribute(NAMES).Get()) == FOREST.names
    assert [target.name for target in trees.GetPrototypesRel().GetTargets()] == list(FOREST.prototypes)
    assert_allclose(trees.GetPositionsAttr().Get(), FOREST.position, atol=1e-6)


def test_turns_are_there_for_readers_of_halfs_too(points: Path) -> None:
    stage = Usd.Stage.Open(str(points))
    trees = UsdGeom.PointInstancer(stage.GetPrimAtPath("/points/trees"))
    for turns in (trees.GetOrientationsAttr().Get(), trees.GetOrientationsfAttr().Get()):
        yaw = [2 * np.arctan2(turn.GetImaginary()[1], turn.GetReal()) for turn in turns]
        assert_allclose(yaw, FOREST.yaw, atol=2e-3)


def test_an_unloaded_instancer_still_has_its_box(points: Path) -> None:
    loaded, unloaded = Usd.Stage.Open(str(points)), Usd.Stage.Open(str(points), Usd.Stage.LoadNone)
    hint = UsdGeom.ModelAPI(unloaded.GetPrimAtPath("/points/trees")).GetExtentsHint()
    extent = UsdGeom.PointInstancer(loaded.GetPrimAtPath("/points/trees")).GetExtentAttr().Get()
    assert_allclose(hint, extent)
    assert not unloaded.GetPrimAtPath("/points/trees").GetAttribute("positions").HasAuthoredValue()


def test_the_forests_box_holds_every_corner_and_no_more() -> None:
    forest = replace(many(1), yaw=np.array([np.pi / 2]), scale=np.array([2.0]), position=np.array([[10.0, 1.0, 0.0]]))
    box = np.array([[[-1.0, 0.0, -2.0], [3.0, 5.0, 4.0]]])
    #  a quarter turn takes +X to -Z and +Z to +X: x in -2..4, z in -3..1, then twice as large
    assert_allclose(forest_box(forest, box), [[10 - 4, 1, -6], [10 + 8, 11, 2]], atol=1e-5)


@pytest.mark.parametrize("kind", ["native", "points"])
def test_no_validator_finds_anything_in_either_kind(kind: str, scene: Path, points: Path) -> None:
    path = {"native": scene, "points": points}[kind]
    assert [finding.line() for finding in validate_file(path)] == []
    nvidia = pytest.importorskip("usd_validation_nvidia")
    assert list(nvidia.ValidationEngine().validate(str(path)).issues()) == []


@pytest.mark.parametrize(("count", "kind"), [(MANY, "Xform"), (MANY + 1, "PointInstancer")])
def test_many_trees_become_an_instancer(count: int, kind: str, assets: dict[str, Path], tmp_path: Path) -> None:
    path = write_forest(many(count), assets, {}, tmp_path / "many.usda", "many")
    assert Sdf.Layer.FindOrOpen(str(path)).GetPrimAtPath("/many/trees").typeName == kind
    assert path.with_name("many_trees.usdc").exists() == (kind == "PointInstancer")


def test_an_unknown_instancing_leaves_no_file(assets: dict[str, Path], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected one of auto, native, points"):
        write_forest(many(3), assets, {}, tmp_path / "a.usda", "a", instancing="cloud")  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_both_kinds_have_the_same_bytes_each_time(assets: dict[str, Path], tmp_path: Path) -> None:
    written = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        folder.mkdir()
        near = {name: folder / name / path.name for name, path in assets.items()}
        for name, path in assets.items():
            near[name].parent.mkdir()
            near[name].write_bytes(path.read_bytes())
        for kind in ("native", "points"):
            write_forest(many(20), near, {}, folder / f"{kind}.usda", kind, instancing=kind)
        written.append({path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()})
    assert set(written[0]) == {"native.usda", "points.usda", "points_trees.usdc"}
    assert written[0] == written[1]
