"""Profiles of a tree in a season, light and look: what was chosen, its pictures and no others."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Usd

from forestgen.usd.composed import Composed
from forestgen.usd.profiles import PROFILES, write_profile
from forestgen.usd.read import read_drawables
from forestgen.usd.tree_asset import write_tree_asset
from forestgen.usd.validate import validate
from tests.usd.dressed_tree import DRESS, dressed
from tests.usd.models import tree_model
from tests.usd.test_levels import extras

MADE_OVER = [profile for profile in PROFILES if profile != "usd"]
PICTURES = {  # of the full level
    ("photo", "baked"): {"bark.png", "leaf.png"},
    ("photo", "delit"): {"bark.png", "leaf_delit.png"},
    ("autumn", "baked"): {"bark.png", "leaf_autumn.png"},
    ("autumn", "delit"): {"bark.png", "leaf_autumn_delit.png"},
    ("winter", "baked"): {"bark.png"},
}


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a tree with three levels, seasons, two lights and two looks; not to be changed."""
    folder = tmp_path_factory.mktemp("trees") / "oak"
    dressed(write_tree_asset(tree_model(), folder, extras(tree_model())), DRESS)
    return folder


def triangles(path: Path) -> int:
    return sum(drawable.n_triangles for drawable in read_drawables(path))


@pytest.mark.parametrize("look", ["preview", "openpbr"])
@pytest.mark.parametrize(("season", "light"), PICTURES)
@pytest.mark.parametrize("profile", ["blender", "web"])
def test_one_level_has_the_pictures_of_its_choice(
    tree: Path, tmp_path: Path, profile: str, season: str, light: str, look: str
) -> None:
    chosen = {"season": season, "light": light, "look": look}
    path = write_profile(tree, tmp_path, profile, variants=chosen)
    assert validate(path) == []
    stage = Usd.Stage.Open(str(path))
    files = {
        Path(attribute.Get().path).name
        for prim in stage.Traverse()
        for attribute in prim.GetAttributes()
        if attribute.GetTypeName() == "asset" and attribute.Get()
    }
    assert files == PICTURES[season, light]
    assert not any(prim.GetName().startswith("openpbr") for prim in stage.Traverse())
    expected = {"photo": 12 + 50, "autumn": 12 + 47, "winter": 12}[season]  # three leaves have fallen
    assert triangles(path) == expected == sum(d.n_triangles for d in Composed(tree / "oak.usda", chosen).drawables())


def test_unreal_keeps_every_level_of_a_season(tree: Path, tmp_path: Path) -> None:
    path = write_profile(tree, tmp_path, "unreal", variants={"season": "autumn"})
    assert validate(path) == []
    assert {file.name for file in (tmp_path / "textures").iterdir()} == {
        "bark.png",
        "leaf_autumn.png",
        "leaf_cards_autumn.png",
    }
    counts = []
    for level in ("LOD0", "LOD1", "LOD2"):
        counts.append(sum(d.n_triangles for d in Composed(path, {"LOD": level}).drawables()))
    assert counts == [12 + 47, 12 + 15, 24]


def test_usd_brings_every_choice_along(tree: Path, tmp_path: Path) -> None:
    path = write_profile(tree, tmp_path, "usd")
    here = {file.relative_to(tree) for file in tree.rglob("*") if file.is_file()}
    assert {file.relative_to(tmp_path) for file in tmp_path.rglob("*") if file.is_file()} == here
    names = Usd.Stage.Open(str(path))
    assert set(names.GetDefaultPrim().GetVariantSets().GetNames()) == {"season", "light", "look", "LOD"}
