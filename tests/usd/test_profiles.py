"""Profiles: the same tree for each reader, complete, valid, and nothing left of one that failed."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Sdf, Usd, UsdGeom, UsdShade

from forestgen.errors import InputError
from forestgen.render.drawable import Drawable
from forestgen.usd import profiles
from forestgen.usd.profiles import FLAT, PROFILES, find_root, write_profile
from forestgen.usd.read import read_drawables
from forestgen.usd.tree_asset import write_tree_asset
from forestgen.usd.validate import validate
from tests.usd.models import tree_model
from tests.usd.subjects import SUBJECTS, write_subjects


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene of a leafy and a bare tree, beside it the same by an instancer of trees; not to be changed."""
    return write_subjects(tmp_path_factory.mktemp("aus ü"))


@pytest.fixture(scope="module")
def made(out: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], Path]:
    """Every profile of both trees and of the scene, by (subject, profile); not to be changed."""
    home = tmp_path_factory.mktemp("profiles")
    return {
        (subject, profile): write_profile(out.parent / where, home / subject / profile, profile)
        for subject, where in SUBJECTS.items()
        for profile in PROFILES
    }


def seen(drawables: list[Drawable]) -> dict[str, object]:
    """What is drawn, told by numbers that do not depend on how it is stored."""
    points = np.concatenate(
        [
            (d.points @ place[:3, :3].T + place[:3, 3])[d.faces].reshape(-1, 3)
            for d in drawables
            for place in d.transforms
        ]
    )
    return {
        "triangles": sum(d.n_triangles for d in drawables),
        "low": points.min(axis=0),
        "high": points.max(axis=0),
        "sum": points.sum(axis=0) / len(points),
        "spread": np.square(points).sum(axis=0) / len(points),
        "leaves": sum(d.n_triangles for d in drawables if d.is_leaf),
    }


def assert_same_picture(path: Path, source: Path) -> None:
    ours, theirs = seen(read_drawables(path)), seen(read_drawables(source))
    for key in ("triangles", "leaves"):
        assert ours[key] == theirs[key]
    for key in ("low", "high", "sum", "spread"):
        assert_allclose(ours[key], theirs[key], atol=2e-5, err_msg=key)  # float32 of metres


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("subject", SUBJECTS)
def test_no_validator_finds_anything(made: dict[tuple[str, str], Path], subject: str, profile: str) -> None:
    nvidia = pytest.importorskip("usd_validation_nvidia")
    path = made[subject, profile]
    assert validate(path) == []
    assert [str(issue) for issue in nvidia.ValidationEngine().validate(str(path)).issues()] == []


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("subject", SUBJECTS)
def test_every_profile_shows_the_full_tree(
    made: dict[tuple[str, str], Path], out: Path, subject: str, profile: str
) -> None:
    """Small enough for all budgets here: the finest level everywhere."""
    assert_same_picture(made[subject, profile], find_root(out.parent / SUBJECTS[subject]))


@pytest.mark.parametrize("profile", PROFILES)
def test_bytes_depend_on_the_source_alone(
    made: dict[tuple[str, str], Path], out: Path, tmp_path: Path, profile: str
) -> None:
    moved = tmp_path / "elsewhere" / "trees" / "oak"
    shutil.copytree(out / "trees" / "oak", moved)
    again = write_profile(moved, tmp_path / "again", profile).parent
    first = made["oak", profile].parent
    files = sorted(path.relative_to(first) for path in first.rglob("*") if path.is_file())
    assert files == sorted(path.relative_to(again) for path in again.rglob("*") if path.is_file())
    for file in files:
        data = (first / file).read_bytes()
        assert data == (again / file).read_bytes(), file
        assert str(first.parents[2]).encode() not in data
        assert str(out.parent).encode() not in data


@pytest.mark.parametrize("profile", PROFILES)
def test_a_profile_can_be_moved_alone(made: dict[tuple[str, str], Path], tmp_path: Path, profile: str) -> None:
    here = shutil.move(shutil.copytree(made["oak", profile].parent, tmp_path / "a"), tmp_path / "b")
    path = Path(here) / made["oak", profile].name
    assert_same_picture(path, made["oak", profile])
    stage = Usd.Stage.Open(str(path))
    for layer in stage.GetUsedLayers():
        assert layer.anonymous or layer.realPath.startswith(str(here))


def test_usd_is_the_asset_file_by_file(made: dict[tuple[str, str], Path], out: Path) -> None:
    for subject, where in SUBJECTS.items():
        copied = made[subject, "usd"].parent
        home = out.parent / where
        for file in (path.relative_to(home) for path in home.rglob("*") if path.is_file()):
            assert (copied / file).read_bytes() == (home / file).read_bytes()
    stage = Usd.Stage.Open(str(made["oak", "usd"]))
    assert stage.GetDefaultPrim().GetVariantSet("LOD").GetVariantNames() == ["LOD0", "LOD1", "LOD2", "all"]


def test_usd_leaves_the_photos_behind(out: Path, tmp_path: Path) -> None:
    tree = tmp_path / "oak"
    shutil.copytree(out / "trees" / "oak", tree)
    (tree / "reference").mkdir()
    (tree / "reference" / "photo.png").write_bytes(b"a photo")
    copied = write_profile(tree, tmp_path / "copy", "usd").parent
    assert not (copied / "reference").exists()
    assert (copied / "cameras.usda").is_file()


def test_blender_keeps_instances_of_one_level_in_one_payload(made: dict[tuple[str, str], Path]) -> None:
    path = made["oak", "blender"]
    assert sorted(entry.name for entry in path.parent.iterdir()) == [
        "cameras.usda",
        "oak.usda",
        "payload.usdc",
        "textures",
    ]
    assert sorted(entry.name for entry in (path.parent / "textures").iterdir()) == ["bark.png", "leaf.png"]
    stage = Usd.Stage.Open(str(path))
    assert not stage.GetDefaultPrim().GetVariantSets().GetNames()
    assert [child.GetName() for child in stage.GetPrimAtPath("/oak/geo").GetAllChildren()] == ["LOD0"]
    assert UsdGeom.PointInstancer(stage.GetPrimAtPath("/oak/geo/LOD0/leaves")).GetInstanceCount() == 600
    assert {prim.GetName() for prim in stage.GetPrimAtPath("/oak/mtl").GetChildren()} == {"bark", "leaf"}
    assert len(stage.GetRootLayer().rootPrims) == 1


def test_blender_of_a_coarser_level(out: Path, tmp_path: Path) -> None:
    path = write_profile(out / "trees" / "oak", tmp_path / "b", "blender", level=2)
    stage = Usd.Stage.Open(str(path))
    assert [child.GetName() for child in stage.GetPrimAtPath("/oak/geo").GetAllChildren()] == ["LOD2"]
    assert {prim.GetName() for prim in stage.GetPrimAtPath("/oak/mtl").GetChildren()} == {"bark", "leaf_cards"}
    assert sorted(entry.name for entry in (path.parent / "textures").iterdir()) == ["bark.png", "leaf_cards.png"]


@pytest.mark.parametrize("profile", FLAT)
def test_flat_profiles_are_one_package_of_plain_meshes(made: dict[tuple[str, str], Path], profile: str) -> None:
    path = made["oak", profile]
    assert [entry.name for entry in path.parent.iterdir()] == ["oak.usdz"]
    with zipfile.ZipFile(path) as archive:
        assert archive.namelist() == ["oak.usdc", "textures/bark.png", "textures/leaf.png"]
    layer = Sdf.Layer.OpenAsAnonymous(str(path))
    assert not layer.GetCompositionAssetDependencies()
    types = set()

    def visit(at: Sdf.Path) -> None:
        if at.IsPrimPath():
            prim = layer.GetPrimAtPath(at)
            types.add(prim.typeName)
            assert prim.specifier == Sdf.SpecifierDef
            assert not prim.variantSets
            assert not prim.hasReferences
            assert not prim.hasPayloads

    layer.Traverse("/oak", visit)
    assert types == {"Xform", "Scope", "Mesh", "Material", "Shader"}
    stage = Usd.Stage.Open(str(path))
    assert [prim.GetName() for prim in stage.GetPrimAtPath("/oak/geo").GetChildren()] == ["branches", "leaves"]
    leaves = UsdGeom.Mesh(stage.GetPrimAtPath("/oak/geo/leaves"))
    assert len(leaves.GetPointsAttr().Get()) == 4 * 600
    st = UsdGeom.PrimvarsAPI(leaves).GetPrimvar("st")  # three.js takes indices for those of corners
    assert st.GetInterpolation() == UsdGeom.Tokens.faceVarying
    assert len(st.Get()) == 6
    assert len(st.GetIndices()) == 3 * 2 * 600
    assert len(leaves.GetFaceVertexCountsAttr().Get()) == 2 * 600
    surface = stage.GetPrimAtPath("/oak/mtl/leaf/surface")
    assert surface.GetAttribute("inputs:opacityThreshold").Get() == 0.5
    assert not surface.HasAttribute("inputs:opacityMode")  # newer than ARKit's readers


@pytest.mark.parametrize("subject", ["wood", "points"])
@pytest.mark.parametrize("profile", FLAT)
def test_a_flat_scene_has_each_tree_once_with_all_its_standings(
    made: dict[tuple[str, str], Path], profile: str, subject: str
) -> None:
    stage = Usd.Stage.Open(str(made[subject, profile]))
    assert Usd.ModelAPI(stage.GetDefaultPrim()).GetKind() == "assembly"
    assert [prim.GetName() for prim in stage.GetDefaultPrim().GetChildren()] == ["oak", "bare", "ground"]
    leaves = UsdGeom.Mesh(stage.GetPrimAtPath("/wood/oak/geo/leaves"))
    assert len(leaves.GetFaceVertexCountsAttr().Get()) == 2 * 2 * 600  # the oak and its copy
    with zipfile.ZipFile(made[subject, profile]) as archive:
        assert "oak/textures/leaf.png" in archive.namelist()
        assert "bare/textures/bark.png" in archive.namelist()


def test_the_finest_level_of_few_enough_triangles_is_chosen(
    out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tree = out / "trees" / "oak"
    counts = [
        sum(d.n_triangles for d in read_drawables(write_profile(tree, tmp_path / f"{k}", "web", level=k)))
        for k in range(3)
    ]
    assert counts[0] > counts[1] == 12 + 2 * 200 > counts[2] == 24
    for most, expected in ((counts[0], 0), (counts[0] - 1, 1), (counts[1], 1), (counts[1] - 1, 2), (24, 2)):
        monkeypatch.setitem(profiles.TRIANGLES, "web", most)
        path = write_profile(tree, tmp_path / f"most{most}", "web")
        assert sum(d.n_triangles for d in read_drawables(path)) == counts[expected]
    monkeypatch.setitem(profiles.TRIANGLES, "web", 23)
    with pytest.raises(InputError, match=r"at most 23 triangles \(level 0: .*level 2: 24\); give --max-triangles 23"):
        write_profile(tree, tmp_path / "none", "web")
    assert not (tmp_path / "none").exists()


def test_unreal_has_one_mesh_a_variant_named_after_it(made: dict[tuple[str, str], Path], out: Path) -> None:
    """What UsdUtils::IterateLODMeshes of Unreal's importer looks for, looked for the same way."""
    stage = Usd.Stage.Open(str(made["oak", "unreal"]))
    root = stage.GetDefaultPrim()
    choice = root.GetVariantSet("LOD")
    assert choice.GetVariantNames() == ["LOD0", "LOD1", "LOD2"]
    assert choice.GetVariantSelection() == "LOD0"
    triangles = []
    for name in choice.GetVariantNames():
        choice.SetVariantSelection(name)
        meshes = [child for child in root.GetChildren() if child.IsA(UsdGeom.Mesh)]
        assert [mesh.GetName() for mesh in meshes] == [name]
        mesh = UsdGeom.Mesh(meshes[0])
        triangles.append(len(mesh.GetFaceVertexCountsAttr().Get()))
        subsets = UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets()
        expected = ["bark", "leaf_cards"] if name == "LOD2" else ["bark", "leaf"]
        assert [subset.GetPrim().GetName() for subset in subsets] == expected
        faces = np.concatenate([np.array(subset.GetIndicesAttr().Get()) for subset in subsets])
        assert_array_equal(np.sort(faces), np.arange(triangles[-1]))
        for subset in subsets:
            material, _ = UsdShade.MaterialBindingAPI(subset.GetPrim()).ComputeBoundMaterial()
            assert material.GetPath() == f"/oak/mtl/{subset.GetPrim().GetName()}"
    full = sum(d.n_triangles for d in read_drawables(out / "trees" / "oak" / "oak.usda"))
    assert triangles == [full, 12 + 2 * 200, 24]
    assert not any(prim.IsA(UsdGeom.PointInstancer) for prim in stage.TraverseAll())


def test_unreal_of_a_bare_tree_has_one_material_and_no_subset(made: dict[tuple[str, str], Path]) -> None:
    stage = Usd.Stage.Open(str(made["bare", "unreal"]))
    mesh = stage.GetPrimAtPath("/bare/LOD0")
    assert not mesh.GetChildren()
    assert mesh.GetRelationship("material:binding").GetTargets() == [Sdf.Path("/bare/mtl/bark")]


def test_a_scene_is_the_same_scene_of_trees_made_over(made: dict[tuple[str, str], Path], out: Path) -> None:
    for profile in ("blender", "unreal"):
        path = made["wood", profile]
        assert path.read_bytes() == (out / "wood.usda").read_bytes()
        assert (path.parent / "trees" / "oak" / "oak.usda").read_bytes() == made["oak", profile].read_bytes()
        stage = Usd.Stage.Open(str(path))
        assert stage.GetPrimAtPath("/wood/cameras/oak/cameras/view_00").GetTypeName() == "Camera"


def test_an_earlier_profile_is_replaced_and_other_files_stay(out: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    write_profile(out / "trees" / "oak", tmp_path, "blender", level=2)
    path = write_profile(out / "trees" / "oak", tmp_path, "blender")
    assert_same_picture(path, out / "trees" / "oak" / "oak.usda")
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert not (tmp_path / "textures" / "leaf_cards.png").exists()


def test_a_tree_without_a_choice_of_levels_is_all_level_0(tmp_path: Path) -> None:
    tree = write_tree_asset(tree_model(), tmp_path / "oak").parent
    path = write_profile(tree, tmp_path / "u", "unreal")
    assert Usd.Stage.Open(str(path)).GetDefaultPrim().GetVariantSet("LOD").GetVariantNames() == ["LOD0"]
    assert_same_picture(write_profile(tree, tmp_path / "w", "web", level=0), tree / "oak.usda")
    with pytest.raises(InputError, match="no level of detail 1; it has 0 to 0"):
        write_profile(tree, tmp_path / "x", "web", level=1)
