"""A finished tree: levels, pictures and seasons that fit each other, in an asset that no validator faults."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pxr import Sdf, UsdShade

from forestgen.errors import InputError
from forestgen.finishing import Finish, coarsening, finish
from forestgen.reference import write_provenance
from forestgen.tree.level import EMPTY_MESH, Level
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Leaves, TreeModel
from forestgen.usd.extras import Extras
from forestgen.usd.layers import open_stage
from forestgen.usd.read import stage_drawables
from forestgen.usd.read_model import read_levels
from forestgen.usd.tree_asset import write_tree_asset
from forestgen.usd.validate import validate_file
from tests.small_scene import digests
from tests.tree.skeletons import random_tree
from tests.usd.models import tree_model


def leafy(*, n_leaves: int = 400, evergreen: bool = False) -> TreeModel:
    """A tree with green leaves on its twigs."""
    rng = np.random.default_rng(5)
    skeleton = random_tree(200, rng=rng)
    node = rng.integers(40, 200, n_leaves)
    turn = rng.normal(size=(n_leaves, 4))
    leaves = Leaves(
        position=skeleton.position[node],
        orientation=turn / np.linalg.norm(turn, axis=1, keepdims=True),
        size=rng.uniform(0.1, 0.2, n_leaves),
        prototype=rng.integers(0, 3, n_leaves),
    )
    model = tree_model(leaves=leaves)
    rgba = model.atlas.rgba.copy()
    rgba[..., :3] = [60, 120, 30]
    mesh = GeneralisedCylinders()(skeleton, model.bark)
    atlas = replace(model.atlas, rgba=rgba)
    return replace(model, skeleton=skeleton, mesh=mesh, atlas=atlas, evergreen=evergreen)


@pytest.fixture(scope="module")
def model() -> TreeModel:
    return leafy()


@pytest.fixture(scope="module")
def extras(model: TreeModel) -> Extras:
    return finish(model, Finish(delit=True, openpbr=True))


@pytest.fixture(scope="module")
def tree(model: TreeModel, extras: Extras, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trees") / "oak"
    write_tree_asset(model, folder, extras)
    write_provenance(model, folder / "reference")
    return folder


def shown(tree: Path, **variants: str) -> dict[str, int]:
    """Places by drawable, with these variants chosen."""
    stage = open_stage(tree / "oak.usda")
    root = stage.GetDefaultPrim()
    for name, variant in variants.items():
        assert root.GetVariantSet(name).SetVariantSelection(variant), name
    return {drawable.name: len(drawable.transforms) for drawable in stage_drawables(stage, root.GetPath())}


def picture(tree: Path, material: str, **variants: str) -> str:
    stage = open_stage(tree / "oak.usda")
    root = stage.GetDefaultPrim()
    for name, variant in variants.items():
        root.GetVariantSet(name).SetVariantSelection(variant)
    surface = UsdShade.Material(stage.GetPrimAtPath(f"/oak/mtl/{material}")).ComputeSurfaceSource()[0]
    source = surface.GetInput("diffuseColor").GetConnectedSources()[0][0].source
    return Path(UsdShade.Shader(source.GetPrim()).GetInput("file").Get().path).name


def test_a_plain_tree_has_no_levels_and_no_pictures(model: TreeModel, tmp_path: Path) -> None:
    write_tree_asset(model, tmp_path / "oak", finish(model, Finish(plain=True)))
    stage = open_stage(tmp_path / "oak" / "oak.usda")
    root = stage.GetDefaultPrim()
    assert root.GetVariantSets().GetNames() == []
    assert root.GetChild("guides")
    assert root.GetChild("geo").GetChild("LOD0")
    assert sorted(path.name for path in (tmp_path / "oak" / "textures").iterdir()) == ["bark.png", "leaf.png"]
    assert len(read_levels(tmp_path / "oak")) == 1
    assert validate_file(tmp_path / "oak" / "oak.usda") == []
    with pytest.raises(InputError, match="give one of them"):
        Finish(plain=True, delit=True)


def test_no_variant_has_a_finding(tree: Path) -> None:
    assert validate_file(tree / "oak.usda") == []


NVIDIA = """
import sys
import usd_validation_nvidia
issues = list(usd_validation_nvidia.ValidationEngine().validate(sys.argv[1]).issues())
print(*issues, sep="\\n")
sys.exit(bool(issues))
"""


def test_nvidias_validator_finds_nothing_in_what_is_written_unasked(model: TreeModel, tmp_path: Path) -> None:
    """In a process of its own, that knows nothing of ours."""
    pytest.importorskip("usd_validation_nvidia")
    asset = write_tree_asset(model, tmp_path / "oak", finish(model))
    done = subprocess.run([sys.executable, "-c", NVIDIA, asset], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, "")


def test_all_sets_are_there_and_show_the_tree_as_photographed(tree: Path) -> None:
    stage = open_stage(tree / "oak.usda")
    root = stage.GetDefaultPrim()
    sets = {name: root.GetVariantSet(name) for name in root.GetVariantSets().GetNames()}
    chosen = {name: choice.GetVariantSelection() for name, choice in sets.items()}
    assert chosen == {"LOD": "LOD0", "season": "photo", "look": "preview", "light": "baked"}
    assert sorted(sets["season"].GetVariantNames()) == ["autumn", "photo", "summer", "winter"]


def test_winter_is_bare_in_every_level(tree: Path) -> None:
    for level in ("LOD0", "LOD1", "LOD2"):
        names = shown(tree, LOD=level, season="winter")
        assert names, level
        assert not any("leaves" in name for name in names), level
        assert any("leaves" in name for name in shown(tree, LOD=level, season="summer"))
    cards = f"LOD{len(read_levels(tree)) - 1}"
    assert any("leaf_cards" in name for name in shown(tree, LOD=cards, season="winter"))
    assert picture(tree, "leaf_cards", season="winter") == "leaf_cards_winter.png"


def test_autumn_has_fewer_leaves_of_another_colour(tree: Path, extras: Extras, model: TreeModel) -> None:
    def leaves(season: str) -> int:
        return sum(n for name, n in shown(tree, season=season).items() if "leaves" in name)

    assert leaves("summer") == leaves("photo") == len(model.leaves)
    assert 0.6 * len(model.leaves) < leaves("autumn") < 0.9 * len(model.leaves)
    assert picture(tree, "leaf", season="autumn") == "leaf_autumn.png"
    assert picture(tree, "leaf", season="summer") == "leaf.png", "a summer photo is not made over"
    red, green = (extras.pictures["leaf_autumn"][..., k].mean() for k in (0, 1))
    assert red > green
    assert_array_equal(extras.pictures["leaf_autumn"][..., 3], model.atlas.rgba[..., 3])


def test_light_goes_with_every_season(tree: Path) -> None:
    assert picture(tree, "leaf", light="delit") == "leaf_delit.png"
    assert picture(tree, "leaf", light="delit", season="autumn") == "leaf_delit_autumn.png"
    assert picture(tree, "leaf_cards", light="delit", season="winter") == "leaf_cards_winter.png"


def test_every_picture_that_is_named_is_there_and_none_is_idle(tree: Path) -> None:
    named = set()
    for path in tree.glob("*.usd?"):
        layer = Sdf.Layer.OpenAsAnonymous(str(path))
        named |= {Path(word).name for word in layer.ExportToString().split("@") if word.endswith(".png")}
    assert named == {path.name for path in (tree / "textures").iterdir()}


def test_an_evergreen_keeps_its_leaves(tmp_path: Path) -> None:
    model = leafy(evergreen=True)
    write_tree_asset(model, tmp_path / "oak", finish(model))
    for season in ("autumn", "winter"):
        assert sum(n for name, n in shown(tmp_path / "oak", season=season).items() if "leaves" in name) == 400
    assert picture(tmp_path / "oak", "leaf", season="winter") == "leaf_winter.png"
    assert validate_file(tmp_path / "oak" / "oak.usda") == []


def test_a_bare_tree_is_bare_in_its_photo(tmp_path: Path) -> None:
    model = replace(leafy(), leaves=tree_model(n_leaves=0).leaves, atlas=tree_model(n_leaves=0).atlas)
    extras = finish(model)
    write_tree_asset(model, tmp_path / "oak", extras)
    assert list(extras.seasons) == ["photo", "winter"]
    assert not any("winter" in name for name in extras.pictures)
    assert shown(tmp_path / "oak", season="winter") == shown(tmp_path / "oak")
    assert validate_file(tmp_path / "oak" / "oak.usda") == []


def test_the_same_tree_gives_the_same_bytes(tree: Path, model: TreeModel, tmp_path: Path) -> None:
    write_tree_asset(model, tmp_path / "oak", finish(model, Finish(delit=True, openpbr=True)))
    write_provenance(model, tmp_path / "oak" / "reference")
    assert digests(tmp_path / "oak") == digests(tree)


def test_no_opengl_is_needed(model: TreeModel, extras: Extras, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("pyrender", "OpenGL", "pyglet"):
        monkeypatch.setitem(sys.modules, module, None)
    again = finish(model, Finish(delit=True, openpbr=True))
    assert sorted(again.pictures) == sorted(extras.pictures)
    for name, image in again.pictures.items():
        assert_array_equal(image, extras.pictures[name], err_msg=name)


def test_levels_that_are_no_coarser_are_left_out(model: TreeModel) -> None:
    same = Level(model.mesh, model.leaves, model.atlas.prototypes, EMPTY_MESH, 400.0)
    fewer = Level(model.mesh, tree_model(n_leaves=0).leaves, (), EMPTY_MESH, 150.0)
    larger = replace(fewer, switch_px=300.0)
    assert coarsening(model, [same, fewer, larger]) == (fewer,)
