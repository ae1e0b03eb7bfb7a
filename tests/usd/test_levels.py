"""Levels of detail in a written tree: one truth, chosen by a variant, by UsdLod, or read back as data."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Gf, Usd, UsdGeom, UsdLod

from forestgen.errors import InputError
from forestgen.reference import write_provenance
from forestgen.tree.level import EMPTY_MESH, NO_LEAVES, Level, full_level
from forestgen.tree.model import Leaves, TreeModel
from forestgen.tree.skeleton_json import skeleton_from_json
from forestgen.usd.extras import Extras
from forestgen.usd.layers import open_stage
from forestgen.usd.read import read_drawables
from forestgen.usd.read_model import read_card_atlas, read_levels, read_model
from forestgen.usd.tree_asset import write_tree_asset
from forestgen.usd.validate import validate
from tests.usd.models import box_mesh, tree_model

CARD_ATLAS = np.random.default_rng(3).integers(0, 255, (8, 8, 4), dtype=np.uint8)


def extras(model: TreeModel) -> Extras:
    """Every third leaf, then a cube of cards around a thin trunk."""
    few = np.arange(0, len(model.leaves), 3)
    leaves = model.leaves
    thinned = Leaves(leaves.position[few], leaves.orientation[few], leaves.size[few] * 1.7, leaves.prototype[few])
    return Extras(
        levels=(
            Level(box_mesh(0.3, 1.9), thinned, model.atlas.prototypes, EMPTY_MESH, 540.0),
            Level(box_mesh(0.2, 1.0), NO_LEAVES, (), box_mesh(2.0, 3.0), 54.0),
        ),
        pictures={"leaf_cards": CARD_ATLAS},
    )


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a tree with three levels."""
    folder = tmp_path_factory.mktemp("trees") / "oak"
    model = tree_model()
    write_tree_asset(model, folder, extras(model))
    write_provenance(model, folder / "reference")
    return folder


def shown(path: Path, **variants: str) -> dict[str, int]:
    """Triangles by the prim that holds them, with these variants chosen."""
    stage = open_stage(path)
    root = stage.GetDefaultPrim()
    layer = path.with_name("choice.usda")
    chosen = Usd.Stage.CreateNew(str(layer))
    prim = chosen.OverridePrim(root.GetPath())
    prim.GetReferences().AddReference(f"./{path.name}")
    for name, variant in variants.items():
        prim.GetVariantSet(name).SetVariantSelection(variant)
    chosen.Save()
    del chosen
    drawables = read_drawables(layer)
    layer.unlink()
    return {drawable.name: drawable.n_triangles for drawable in drawables}


def test_each_variant_shows_one_level(tree: Path) -> None:
    asset = tree / "oak.usda"
    for k in range(3):
        assert {name.split("/")[3] for name in shown(asset, LOD=f"LOD{k}")} == {f"LOD{k}"}
    full = shown(asset)
    assert full == shown(asset, LOD="LOD0") == shown(asset, LOD="all")
    assert sum(full.values()) == 12 + 50
    assert sum(shown(asset, LOD="LOD1").values()) == 12 + 17
    assert shown(asset, LOD="LOD2") == {"/oak/geo/LOD2/branches": 12, "/oak/geo/LOD2/leaf_cards": 12}


def test_usdlod_chooses_by_the_size_on_the_screen(tree: Path) -> None:
    stage = open_stage(tree / "oak.usda")
    root = stage.GetDefaultPrim()
    assert not stage.GetPrimAtPath("/oak/geo").HasAPI(UsdLod.RootAPI), "its children are not the levels there"
    root.GetVariantSet("LOD").SetVariantSelection("all")
    geo = stage.GetPrimAtPath("/oak/geo")
    assert [child.GetName() for child in geo.GetChildren()] == ["LOD0", "LOD1", "LOD2"]
    assert geo.HasAPI(UsdLod.RootAPI)
    targets = UsdLod.RootAPI(geo).GetLodHeuristicsRel().GetTargets()
    heuristic = UsdLod.ScreenSizeHeuristic(stage.GetPrimAtPath(targets[0]))
    assert_allclose(heuristic.GetThresholdsAttr().Get(), [0.5, 0.05])
    hint = UsdGeom.ModelAPI(root).GetExtentsHint()
    assert_allclose(heuristic.GetExtentAttr().Get(), hint)
    levels = []
    for distance in (3.0, 14.0, 200.0):
        frustum = Gf.Camera(focalLength=50).frustum
        frustum.SetPosition(Gf.Vec3d(0, 1.5, distance))
        levels.append(heuristic.ComputeLOD(frustum, Gf.Matrix4d(1), Usd.TimeCode.Default()))
    assert levels == [0, 1, 2]
    visible = [UsdGeom.Imageable(child).ComputeVisibility() for child in geo.GetChildren()]
    assert visible == ["inherited", "invisible", "invisible"], "readers without UsdLod show the full tree"


@pytest.mark.parametrize("variant", ["LOD0", "LOD1", "LOD2", "all"])
def test_validators_find_nothing_in_any_level(tree: Path, variant: str, tmp_path: Path) -> None:
    nvidia = pytest.importorskip("usd_validation_nvidia")
    text = (tree / "oak.usda").read_text().replace('string LOD = "LOD0"', f'string LOD = "{variant}"')
    assert f'string LOD = "{variant}"' in text
    path = tree / f"oak_{variant}.usda"
    path.write_text(text.replace("oak.usda", path.name))
    assert validate(path) == []
    assert list(nvidia.ValidationEngine().validate(str(path)).issues()) == []


def test_a_tree_comes_back_as_it_was_written(tree: Path) -> None:
    model, back = tree_model(), read_model(tree)
    assert (back.name, back.method, back.seed, back.height) == (model.name, model.method, model.seed, model.height)
    assert_allclose(back.mesh.points, model.mesh.points, atol=1e-6)
    assert_allclose(back.mesh.uv, model.mesh.uv, atol=1e-6)
    assert_array_equal(back.mesh.faces, model.mesh.faces)
    assert_array_equal(back.atlas.rgba, model.atlas.rgba)
    assert_array_equal(back.bark.rgb, model.bark.rgb)
    assert (back.bark.width_m, back.bark.height_m) == (model.bark.width_m, model.bark.height_m)
    assert_allclose(back.leaves.position, model.leaves.position, atol=1e-6)
    assert_allclose(back.leaves.size, model.leaves.size, rtol=1e-6)
    same = np.abs(np.sum(back.leaves.orientation * model.leaves.orientation, axis=1))
    assert_allclose(same, 1, atol=2e-3)
    assert_array_equal(back.skeleton.position, model.skeleton.position)
    for one, other in zip(back.atlas.prototypes, model.atlas.prototypes, strict=True):
        assert_allclose(one.points, other.points, atol=1e-6)
        assert_allclose(one.uv, other.uv, atol=1e-6)


def test_levels_come_back_as_they_were_written(tree: Path) -> None:
    model = tree_model()
    written = (full_level(model), *extras(model).levels)
    back = read_levels(tree)
    assert [level.n_triangles for level in back] == [level.n_triangles for level in written]
    assert [level.n_instances for level in back] == [50, 17, 0]
    assert back[0].switch_px == math.inf
    assert_allclose([level.switch_px for level in back[1:]], [540, 54], rtol=1e-6)
    assert_allclose(back[2].cards.points, written[2].cards.points, atol=1e-6)
    assert_array_equal(read_card_atlas(tree), CARD_ATLAS)


def test_a_tree_without_levels_has_one(oak: Path, tmp_path: Path) -> None:
    folder = tmp_path / "bare"
    model = replace(tree_model(n_leaves=0, name="bare"), name="bare")
    write_tree_asset(model, folder)
    write_provenance(model, folder / "reference")
    assert [level.n_triangles for level in read_levels(folder)] == [12]
    assert read_card_atlas(folder) is None
    assert not len(read_model(folder).atlas.prototypes)
    assert open_stage(folder / "bare.usda").GetDefaultPrim().GetVariantSets().GetNames() == []


def test_what_is_no_tree_is_refused(tmp_path: Path, scene: Path) -> None:
    with pytest.raises(InputError, match="expected the folder of a built tree"):
        read_model(tmp_path)
    (tmp_path / "scene").mkdir()
    (tmp_path / "scene" / "scene.usda").write_text('#usda 1.0\n(\n    defaultPrim = "a"\n)\ndef Xform "a" {}\n')
    with pytest.raises(InputError, match="build it again"):
        read_levels(tmp_path / "scene")


def test_levels_must_serve_smaller_and_smaller_sizes() -> None:
    level = Level(box_mesh(0.3, 1.9), NO_LEAVES, (), EMPTY_MESH, 100.0)
    with pytest.raises(ValueError, match="smaller and smaller"):
        Extras(levels=(level, level))


def test_wind_and_guides_come_with_every_level(tmp_path: Path) -> None:
    model = tree_model()
    folder = tmp_path / "oak"
    write_tree_asset(model, folder, replace(extras(model), wind=True, guides=True))
    stage = open_stage(folder / "oak.usda")
    stage.GetDefaultPrim().GetVariantSet("LOD").SetVariantSelection("all")
    for where in ("LOD0/branches", "LOD0/leaves", "LOD1/leaves", "LOD2/leaf_cards"):
        prim = stage.GetPrimAtPath(f"/oak/geo/{where}")
        phase = UsdGeom.PrimvarsAPI(prim).GetPrimvar("wind:phase").ComputeFlattened()
        points = prim.GetAttribute("positions" if where.endswith("leaves") else "points").Get()
        assert len(phase) == len(points), where
    assert UsdGeom.Imageable(stage.GetPrimAtPath("/oak/guides/skeleton")).ComputePurpose() == "guide"
    skeleton = skeleton_from_json(json.loads((folder / "skeleton.json").read_text()), "skeleton.json")
    assert_allclose(skeleton.position, model.skeleton.position, atol=1e-6)
    assert validate(folder / "oak.usda") == []
