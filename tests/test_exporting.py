"""Exports: each profile from one written tree or scene, budgets kept, and nothing written where one cannot be."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.errors import InputError
from forestgen.exporting import PROFILES, Wishes, export, parse_variants
from forestgen.finishing import Finish, finish
from forestgen.reference import write_provenance
from forestgen.usd.cameras import write_cameras
from forestgen.usd.forest_scene import write_forest
from forestgen.usd.read import read_drawables
from forestgen.usd.read_forest import read_forest
from forestgen.usd.read_model import read_card_atlas, read_levels, read_model, read_seasons
from forestgen.usd.tree_asset import write_tree_asset
from forestgen.usd.validate import validate_file
from forestgen.usd.variants import variant_sets
from tests.small_scene import digests
from tests.usd.conftest import FOREST
from tests.usd.dressed_tree import BROWN, FALLEN, write_dressed
from tests.usd.models import tree_model
from tests.usd.test_levels import extras


def write_build(folder: Path, instancing: str = "native") -> Path:
    """A build's folder of two trees and their scene, without report and photos."""
    assets, cameras = {}, {}
    for name, n_leaves in (("oak", 50), ("bare", 0)):
        model = tree_model(n_leaves=n_leaves, name=name)
        more = extras(model) if n_leaves else None
        assets[name] = write_tree_asset(model, folder / "trees" / name, more)
        cameras[name] = write_cameras(model, folder / "trees" / name)
        write_provenance(model, folder / "trees" / name / "reference")
    write_forest(FOREST, assets, cameras, folder / "wood.usda", "wood", instancing=instancing)
    return folder


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_build(tmp_path_factory.mktemp("out"))


@pytest.mark.parametrize("profile", PROFILES)
def test_each_profile_writes_the_file_it_names(out: Path, tmp_path: Path, profile: str) -> None:
    (file,) = export(out / "trees" / "oak", tmp_path / "a", profile)
    assert file.parent == tmp_path / "a"
    assert file.stem == "oak"
    assert file.stat().st_size > 500
    if file.suffix.startswith(".usd"):
        assert validate_file(file) == []
    export(out / "trees" / "oak", tmp_path / "b", profile)
    assert digests(tmp_path / "a") == digests(tmp_path / "b")
    assert not [name for name in digests(tmp_path) if "/." in name or name.startswith(".")]


@pytest.mark.parametrize("profile", [name for name in PROFILES if name != "obj"])
@pytest.mark.parametrize("instancing", ["native", "points"])
def test_each_profile_takes_a_scene(tmp_path: Path, profile: str, instancing: str) -> None:
    source = write_build(tmp_path / "out", instancing)
    (file,) = export(source, tmp_path / "made", profile)
    assert file.stem == "wood"
    if file.suffix.startswith(".usd"):
        assert validate_file(file) == []


def test_obj_holds_one_tree(out: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="OBJ holds one tree"):
        export(out, tmp_path / "made", "obj")


def leaf_count(file: Path) -> int:
    return sum(len(drawable.transforms) for drawable in read_drawables(file) if drawable.is_leaf)


@pytest.mark.parametrize("profile", ["usd", "blender"])
def test_budgets_bind_the_finest_level(out: Path, tmp_path: Path, profile: str) -> None:
    (file,) = export(out / "trees" / "oak", tmp_path / "few", profile, Wishes(max_instances=30))
    assert 0 < leaf_count(file) <= 30
    assert validate_file(file) == []
    (file,) = export(out / "trees" / "oak", tmp_path / "low", profile, Wishes(max_triangles=40))
    assert sum(drawable.n_triangles for drawable in read_drawables(file)) <= 40


def test_coarser_levels_stay_coarser_than_a_budget(out: Path, tmp_path: Path) -> None:
    export(out / "trees" / "oak", tmp_path / "oak", "usd", Wishes(max_triangles=40))
    model = tree_model()
    write_provenance(model, tmp_path / "oak" / "reference")
    triangles = [level.n_triangles for level in read_levels(tmp_path / "oak")]
    assert triangles[0] <= 40
    assert triangles == sorted(set(triangles), reverse=True)


def test_a_budget_of_a_scene_binds_each_tree(out: Path, tmp_path: Path) -> None:
    (file,) = export(out, tmp_path / "made", "usd", Wishes(max_instances=30))
    assert 0 < leaf_count(file) <= 60
    assert read_forest(file).names == FOREST.names


@pytest.mark.parametrize("profile", PROFILES)
def test_a_budget_that_no_level_keeps_writes_nothing(out: Path, tmp_path: Path, profile: str) -> None:
    with pytest.raises(InputError, match="give at least"):
        export(out / "trees" / "oak", tmp_path / "made", profile, Wishes(max_triangles=3))
    assert not (tmp_path / "made").exists()


def test_a_rig_comes_beside_the_asset(out: Path, tmp_path: Path) -> None:
    asset, rig = export(out / "trees" / "oak", tmp_path / "oak", "usd", Wishes(rig=True))
    assert asset.name == "oak.usda"
    assert rig.parent == asset.parent
    assert validate_file(rig) == []


@pytest.fixture(scope="module")
def dressed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a tree with seasons; in autumn it loses three leaves, in winter all."""
    folder = tmp_path_factory.mktemp("seasons") / "trees" / "oak"
    write_dressed(folder.parent)
    write_provenance(tree_model(), folder / "reference")
    return folder


def test_a_season_is_read_back_with_its_leaves_and_pictures(dressed: Path) -> None:
    photo, autumn, winter = (read_model(dressed, season) for season in ("photo", "autumn", "winter"))
    kept = np.setdiff1d(np.arange(50), FALLEN["LOD0"])
    assert_allclose(autumn.leaves.position, photo.leaves.position[kept])
    assert_array_equal(autumn.atlas.rgba[..., :3], np.broadcast_to(BROWN, (32, 48, 3)))
    assert not len(winter.leaves)
    assert_array_equal(read_card_atlas(dressed, "winter")[0, 0], (*BROWN, 255))
    assert [len(level.leaves) for level in read_levels(dressed, "autumn")] == [47, 15, 0]
    assert [len(level.leaves) for level in read_levels(dressed, "winter")] == [0, 0, 0]
    assert set(read_seasons(dressed)) == {"photo", "autumn", "winter"}


@pytest.mark.parametrize("profile", [name for name in PROFILES if name != "usd"])
def test_each_profile_takes_a_season(dressed: Path, tmp_path: Path, profile: str) -> None:
    made = {}
    for season in (None, "photo", "autumn", "winter"):
        (file,) = export(dressed, tmp_path / str(season), profile, Wishes(season=season))
        made[season] = digests(tmp_path / str(season))
        if file.suffix.startswith(".usd"):
            assert validate_file(file) == []
    assert made[None] == made["photo"]
    assert made["photo"] != made["autumn"] != made["winter"] != made["photo"]


def test_the_season_of_a_scene_is_that_of_the_trees_that_have_it(dressed: Path, out: Path, tmp_path: Path) -> None:
    source = tmp_path / "out"
    shutil.copytree(out, source)
    with pytest.raises(InputError, match=r"--season: no tree of .* has 'autumn'"):
        export(source, tmp_path / "made", "glb", Wishes(season="autumn"))
    shutil.rmtree(source / "trees" / "oak")
    shutil.copytree(dressed, source / "trees" / "oak")
    (autumn,) = export(source, tmp_path / "autumn", "glb", Wishes(season="autumn"))
    (photo,) = export(source, tmp_path / "photo", "glb")
    assert autumn.stat().st_size < photo.stat().st_size  # fallen leaves, and plainer pictures


@pytest.mark.parametrize(
    ("profile", "wishes", "says"),
    [
        ("fbx", Wishes(), "--profile: expected one of usd, blender"),
        ("obj", Wishes(variants={"season": "autumn"}), "--variant: profile 'obj' has no use for it"),
        ("usd", Wishes(instancing=False), "--no-instancing: profile 'usd'"),
        ("glb", Wishes(rig=True), "--rig: profile 'glb'"),
        ("glb", Wishes(level=7), "has the levels 0 to 2, came 7"),
        ("blender", Wishes(level=7), "7"),
        ("usd", Wishes(max_triangles=-1), "--max-triangles: expected 0 or more"),
        ("blender", Wishes(variants={"moss": "much"}), "moss"),
        ("glb", Wishes(season="spring"), "--season: expected one of photo, summer, autumn, winter, came"),
        ("glb", Wishes(season="autumn"), "has no 'autumn'; it has none"),
        ("obj", Wishes(season="winter"), "has no 'winter'; it has none"),
        ("web", Wishes(season="autumn"), "there is no variant set 'season'"),
        ("web", Wishes(season="autumn", variants={"season": "winter"}), "--variant season=winter says it too"),
        ("usd", Wishes(season="autumn"), "--season: profile 'usd' has no use for it"),
    ],
)
def test_what_cannot_be_granted_is_said_before_anything_is_written(
    out: Path, tmp_path: Path, profile: str, wishes: Wishes, says: str
) -> None:
    with pytest.raises(InputError) as caught:
        export(out / "trees" / "oak", tmp_path / "made", profile, wishes)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("profile", [name for name in PROFILES if name != "usd"])
def test_a_missing_texture_is_named_and_nothing_is_written(out: Path, tmp_path: Path, profile: str) -> None:
    broken = tmp_path / "oak"
    shutil.copytree(out / "trees" / "oak", broken)
    (broken / "textures" / "leaf.png").unlink()
    with pytest.raises(InputError, match=r"leaf\.png"):
        export(broken, tmp_path / "made", profile)
    assert not (tmp_path / "made").exists()


def test_a_folder_that_is_no_build_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected OUT/trees/NAME"):
        export(tmp_path / "nowhere", tmp_path / "made", "usd")


@pytest.mark.parametrize("instancing", ["native", "points"])
def test_a_scene_is_read_back_as_it_stands(tmp_path: Path, instancing: str) -> None:
    forest = read_forest(write_build(tmp_path, instancing) / "wood.usda")
    assert forest.names == FOREST.names
    assert [forest.prototypes[k] for k in forest.prototype] == [FOREST.prototypes[k] for k in FOREST.prototype]
    assert_allclose(forest.position, FOREST.position, atol=1e-6)
    assert_allclose(forest.yaw, FOREST.yaw, atol=1e-6)
    assert_allclose(forest.scale, FOREST.scale, atol=1e-6)


def test_variants_are_read_as_users_write_them() -> None:
    assert parse_variants(["season=autumn", "LOD=LOD1"]) == {"season": "autumn", "LOD": "LOD1"}
    for wrong in (["season"], ["=x"], ["season="], ["a=b", "a=c"]):
        with pytest.raises(InputError, match="expected SET=VARIANT"):
            parse_variants(wrong)


def test_a_budget_keeps_the_variants_that_were_asked_for(tmp_path: Path) -> None:
    model = tree_model()
    write_tree_asset(model, tmp_path / "oak", finish(model, Finish(delit=True, openpbr=True)))
    write_provenance(model, tmp_path / "oak" / "reference")
    (file,) = export(tmp_path / "oak", tmp_path / "few", "usd", Wishes(max_instances=30))
    assert sorted(variant_sets(file)) == ["light", "look", "season"], "so small a tree needs one level"
