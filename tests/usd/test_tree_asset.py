"""A tree as USD: what is reopened from disk is what was modelled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdShade

from forestgen.png import write_png
from forestgen.tree.model import Bark, Leaves
from forestgen.usd.geometry import instances_box, prototype_names, rotation_matrix
from forestgen.usd.tree_asset import write_tree_asset
from tests.usd.models import box_mesh, leaf_prototype, tree_model

FLOAT = 1e-6  # float32 of metres


def test_root_is_a_component_in_metres_with_y_up(oak: Path) -> None:
    stage = Usd.Stage.Open(str(oak))
    root = stage.GetDefaultPrim()
    assert root.GetPath() == "/oak"
    assert root.GetTypeName() == "Xform"
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert Usd.ModelAPI(root).GetKind() == Kind.Tokens.component
    assert Usd.ModelAPI(root).GetAssetName() == "oak"
    assert Usd.ModelAPI(root).GetAssetIdentifier().path == "./oak.usda"
    assert root.GetCustomDataByKey("forestgen") == {"method": "tan2008", "seed": 7, "height": 4.0}
    below = [prim for prim in Usd.PrimRange(root, Usd.PrimAllPrimsPredicate) if prim != root]
    assert len(below) > 10
    assert not any(Usd.ModelAPI(prim).GetKind() for prim in below)


def test_payload_loads_and_unloads_and_the_hint_stays(oak: Path) -> None:
    stage = Usd.Stage.Open(str(oak), Usd.Stage.LoadNone)
    root = stage.GetDefaultPrim()
    assert not root.GetChildren()
    hint = np.array(UsdGeom.ModelAPI(root).GetExtentsHint())
    root.Load()
    assert [child.GetName() for child in root.GetChildren()] == ["geo", "mtl"]
    boxes = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_], useExtentsHint=False)
    box = boxes.ComputeWorldBound(root).ComputeAlignedRange()
    assert_allclose(hint, [box.GetMin(), box.GetMax()], atol=FLOAT)
    root.Unload()
    assert not root.GetChildren()


def test_authored_extent_is_the_computed_one(oak: Path) -> None:
    stage = Usd.Stage.Open(str(oak))
    found = 0
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Boundable):
            found += 1
            boundable = UsdGeom.Boundable(prim)
            computed = UsdGeom.Boundable.ComputeExtentFromPlugins(boundable, Usd.TimeCode.Default())
            assert_allclose(boundable.GetExtentAttr().Get(), computed, atol=FLOAT)
    assert found == 5  # branches, leaves, three prototypes


def test_mesh_comes_back_as_it_was_and_complete(oak: Path) -> None:
    stage = Usd.Stage.Open(str(oak))
    model = tree_model()
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/oak/geo/LOD0/branches"))
    assert_allclose(mesh.GetPointsAttr().Get(), model.mesh.points, atol=FLOAT)
    assert_array_equal(np.reshape(mesh.GetFaceVertexIndicesAttr().Get(), (-1, 3)), model.mesh.faces)
    assert set(mesh.GetFaceVertexCountsAttr().Get()) == {3}
    assert_allclose(mesh.GetNormalsAttr().Get(), model.mesh.normals, atol=FLOAT)
    st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    assert st.GetInterpolation() == mesh.GetNormalsInterpolation() == UsdGeom.Tokens.vertex
    assert st.IsIndexed()  # the box's uv repeat
    assert_allclose(st.ComputeFlattened(), model.mesh.uv, atol=FLOAT)
    assert mesh.GetSubdivisionSchemeAttr().Get() == UsdGeom.Tokens.none
    assert mesh.GetDoubleSidedAttr().Get()


def test_leaves_come_back_as_they_were(oak: Path) -> None:
    stage = Usd.Stage.Open(str(oak))
    model = tree_model()
    leaves = UsdGeom.PointInstancer(stage.GetPrimAtPath("/oak/geo/LOD0/leaves"))
    assert leaves.GetInstanceCount() == len(model.leaves) == 50
    assert_array_equal(leaves.GetProtoIndicesAttr().Get(), model.leaves.prototype)
    assert_allclose(leaves.GetPositionsAttr().Get(), model.leaves.position, atol=FLOAT)
    assert_allclose(leaves.GetScalesAttr().Get(), np.repeat(model.leaves.size[:, None], 3, 1), atol=FLOAT)
    for written, (w, i, j, k) in zip(leaves.GetOrientationsAttr().Get(), model.leaves.orientation, strict=True):
        assert_allclose([written.real, *written.imaginary], [w, i, j, k], atol=1e-3)  # half floats
    targets = leaves.GetPrototypesRel().GetTargets()
    assert targets == [Sdf.Path(f"/oak/geo/LOD0/leaves/Prototypes/leaf_{k:02d}") for k in range(3)]
    assert stage.GetPrimAtPath("/oak/geo/LOD0/leaves/Prototypes").GetTypeName() == "Scope"


def test_each_prototype_is_a_plain_mesh_that_binds_the_leaf_material(oak: Path) -> None:
    stage = Usd.Stage.Open(str(oak))
    for prim in stage.GetPrimAtPath("/oak/geo/LOD0/leaves/Prototypes").GetChildren():
        assert prim.GetTypeName() == "Mesh"
        assert not UsdGeom.Xformable(prim).GetOrderedXformOps()
        assert prim.GetRelationship("material:binding").GetTargets() == [Sdf.Path("/oak/mtl/leaf")]
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        assert material


def test_a_known_quarter_turn_puts_the_leaf_where_it_belongs(tmp_path: Path) -> None:
    # Blade along +Y; a quarter turn about +Z (w x y z = c 0 0 s) lays it along -X.
    half = np.sqrt(0.5)
    leaves = Leaves(
        position=np.array([[1.0, 2.0, 3.0]]),
        orientation=np.array([[half, 0.0, 0.0, half]]),
        size=np.array([0.5]),
        prototype=np.array([0]),
    )
    stage = Usd.Stage.Open(str(write_tree_asset(tree_model(leaves=leaves), tmp_path / "oak")))
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/oak/geo/LOD0/leaves"))
    time = Usd.TimeCode.Default()
    (place,) = instancer.ComputeInstanceTransformsAtTime(time, time)
    assert_allclose(place.Transform(Gf.Vec3d(0, 1, 0)), [0.5, 2.0, 3.0], atol=1e-3)


def test_instancer_extent_by_hand(tmp_path: Path) -> None:
    # leaf_prototype(0): x -0.2..0.2, y 0..1, z 0..0.05. Twice as large at the origin, and 3 m up on its head.
    leaves = Leaves(
        position=np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 0.0]]),
        orientation=np.array([[1.0, 0, 0, 0], [0, 0, 0, 1.0]]),
        size=np.array([2.0, 1.0]),
        prototype=np.array([0, 0]),
    )
    path = write_tree_asset(tree_model(leaves=leaves, n_prototypes=1), tmp_path / "oak")
    stage = Usd.Stage.Open(str(path))
    extent = UsdGeom.PointInstancer(stage.GetPrimAtPath("/oak/geo/LOD0/leaves")).GetExtentAttr().Get()
    assert_allclose(extent, [[-0.4, 0.0, 0.0], [0.4, 3.0, 0.1]], atol=FLOAT)


def test_boxes_of_turned_instances_equal_all_corners_turned() -> None:
    rng = np.random.default_rng(3)
    turn, size, position = rng.normal(size=(40, 4)), rng.uniform(0.1, 2, 40), rng.normal(size=(40, 3))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    low = rng.normal(size=(40, 3))
    box = np.stack([low, low + rng.uniform(0, 1, (40, 3))], axis=1).astype(np.float32)
    corner = np.array([[box[k][list(pick), range(3)] for pick in np.ndindex(2, 2, 2)] for k in range(40)])
    turned = np.einsum("lij,lcj->lci", rotation_matrix(turn) * size[:, None, None], corner) + position[:, None]
    expected = [turned.min(axis=(0, 1)), turned.max(axis=(0, 1))]
    assert_allclose(instances_box(position, turn, size, box), expected, atol=1e-5)  # float32 of numbers up to 5


def test_rotation_matrix_is_usds() -> None:
    turn = np.array([0.1, -0.7, 0.3, 0.64])  # i j k real, unit to 1e-3 only
    expected = np.array(Gf.Matrix3d(Gf.Quatd(0.64, 0.1, -0.7, 0.3))).T
    assert_allclose(rotation_matrix(turn[None])[0], expected, atol=1e-12)


def test_bare_tree_has_no_instancer_and_no_leaf_material(bare: Path) -> None:
    stage = Usd.Stage.Open(str(bare))
    assert not any(prim.IsA(UsdGeom.PointInstancer) for prim in stage.Traverse())
    assert [m.GetName() for m in stage.GetPrimAtPath("/bare/mtl").GetChildren()] == ["bark"]
    assert not (bare.parent / "textures" / "leaf.png").exists()


def test_leaf_material_cuts_out_by_the_alpha_of_its_one_texture(oak: Path) -> None:
    stage = Usd.Stage.Open(str(oak))
    surface = UsdShade.Shader(stage.GetPrimAtPath("/oak/mtl/leaf/surface"))
    colour, opacity = (surface.GetInput(name).GetConnectedSource() for name in ("diffuseColor", "opacity"))
    assert (colour[0].GetPath(), colour[1]) == (Sdf.Path("/oak/mtl/leaf/texture"), "rgb")
    assert (opacity[0].GetPath(), opacity[1]) == (Sdf.Path("/oak/mtl/leaf/texture"), "a")
    assert surface.GetInput("opacityThreshold").Get() == 0.5
    assert surface.GetInput("opacityMode").Get() == "presence"
    texture = UsdShade.Shader(colour[0].GetPrim())
    assert not texture.GetInput("scale")
    file = texture.GetInput("file").Get()
    assert file.path == "./textures/leaf.png"
    image = cv2.imdecode(np.frombuffer(Path(file.resolvedPath).read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)
    assert_array_equal(image[..., [2, 1, 0, 3]], tree_model().atlas.rgba)


def test_plain_bark_is_a_colour_in_linear_light(tmp_path: Path) -> None:
    model = replace(tree_model(), bark=Bark(np.array([[[188, 0, 255]]], np.uint8), 1.0, 1.0))
    stage = Usd.Stage.Open(str(write_tree_asset(model, tmp_path / "oak")))
    colour = UsdShade.Shader(stage.GetPrimAtPath("/oak/mtl/bark/surface")).GetInput("diffuseColor").Get()
    assert_allclose(colour, [0.5029, 0.0, 1.0], atol=1e-4)  # sRGB 188 is half the light
    assert not (tmp_path / "oak" / "textures" / "bark.png").exists()


def test_the_root_layer_is_small_and_every_path_is_relative(oak: Path) -> None:
    assert oak.stat().st_size < 2000
    assert {p.name for p in oak.parent.iterdir() if p.suffix == ".usdc"} == {
        "geometry.usdc",
        "materials.usdc",
        "payload.usdc",
    }
    for path in oak.parent.rglob("*.usd?"):
        layer = Sdf.Layer.OpenAsAnonymous(str(path))
        for asset in layer.GetCompositionAssetDependencies():
            assert asset.startswith("./")
        assert str(oak.parents[2]) not in layer.ExportToString()
    for path in oak.parent.rglob("*"):
        assert not path.is_file() or str(oak.parents[2]).encode() not in path.read_bytes()


def test_given_name_of_the_tree_is_kept_for_people(tmp_path: Path) -> None:
    path = write_tree_asset(tree_model(name="Linde am Markt 树"), tmp_path / "linde")
    assert Usd.Stage.Open(str(path)).GetDefaultPrim().GetDisplayName() == "Linde am Markt 树"


@pytest.mark.parametrize("name", ["1oak", "old oak", "é", ""])
def test_no_prim_name_is_refused_and_nothing_written(tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match="is no prim name"):
        write_tree_asset(tree_model(), tmp_path / name if name else Path())
    assert not list(tmp_path.iterdir())


def nan_position() -> Leaves:
    return Leaves(np.full((1, 3), np.nan), np.array([[1.0, 0, 0, 0]]), np.array([0.1]), np.array([0]))


def no_size() -> Leaves:
    return Leaves(np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]), np.array([0.0]), np.array([0]))


def negative_prototype() -> Leaves:
    return Leaves(np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]), np.array([0.1]), np.array([-1]))


@pytest.mark.parametrize(
    ("leaves", "message"),
    [
        (nan_position(), "finite positions"),
        (no_size(), "sizes above 0"),
        (negative_prototype(), "not among the 3 of the atlas"),
    ],
)
def test_bad_leaves_leave_no_file(tmp_path: Path, leaves: Leaves, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        write_tree_asset(tree_model(leaves=leaves), tmp_path / "oak")
    assert not list(tmp_path.iterdir())


def test_bad_meshes_leave_no_file(tmp_path: Path) -> None:
    mesh = box_mesh(1, 1)
    with pytest.raises(ValueError, match="without faces"):
        write_tree_asset(tree_model(mesh=replace(mesh, faces=np.zeros((0, 3), int))), tmp_path / "oak")
    with pytest.raises(ValueError, match="uv holds NaN"):
        write_tree_asset(tree_model(mesh=replace(mesh, uv=np.full((8, 2), np.nan))), tmp_path / "oak")
    assert not list(tmp_path.iterdir())


def test_png_keeps_every_pixel_and_no_time(tmp_path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 255, (5, 7, 4), dtype=np.uint8)
    write_png(tmp_path / "a.png", image)
    data = (tmp_path / "a.png").read_bytes()
    back = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert_array_equal(back[..., [2, 1, 0, 3]], image)
    assert b"tIME" not in data
    assert b"tEXt" not in data


def test_prototype_names_are_as_wide_as_needed() -> None:
    assert prototype_names(2) == ["leaf_00", "leaf_01"]
    assert prototype_names(101)[::100] == ["leaf_000", "leaf_100"]


def test_st_with_one_value_many_times_is_indexed_and_comes_back(tmp_path: Path) -> None:
    leaf = leaf_prototype(0, 1)
    model = tree_model(n_prototypes=1)
    same = replace(leaf, uv=np.array([[0.5, 0.0], [0.5, -0.0], [0.5, 1.0]]))
    model = replace(model, atlas=replace(model.atlas, prototypes=(same,)))
    stage = Usd.Stage.Open(str(write_tree_asset(model, tmp_path / "oak")))
    st = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/oak/geo/LOD0/leaves/Prototypes/leaf_00")).GetPrimvar("st")
    assert len(st.Get()) == 2
    assert_allclose(st.ComputeFlattened(), same.uv)
