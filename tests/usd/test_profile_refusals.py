"""Profiles refuse what they cannot make, in one line, and leave nothing behind."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from forestgen.errors import InputError
from forestgen.usd.profiles import PROFILES, write_profile
from tests.usd.subjects import write_subject


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene of a leafy and a bare tree; not to be changed."""
    folder = tmp_path_factory.mktemp("out")
    write_subject(folder)
    return folder


@pytest.fixture
def tree(out: Path, tmp_path: Path) -> Path:
    """An oak of one's own, to be broken."""
    shutil.copytree(out / "trees" / "oak", tmp_path / "trees" / "oak")
    return tmp_path / "trees" / "oak"


@pytest.mark.parametrize(
    ("profile", "options", "message"),
    [
        ("maya", {}, "no profile 'maya'; it must be one of usd, blender, web, arkit, unreal"),
        ("web", {"level": 7}, "no level of detail 7; it has 0 to 2"),
        ("web", {"level": -1}, "no level of detail -1"),
        ("blender", {"level": 3}, "no level of detail 3"),
        ("unreal", {"level": 1}, "profile 'unreal' holds all levels"),
        ("usd", {"level": 1}, "profile 'usd' holds all levels"),
        ("web", {"variants": {"mood": "sad"}}, "no variant set 'mood'; it has LOD"),
        ("blender", {"variants": {"LOD": "LOD9"}}, "'LOD' has no 'LOD9'; it has LOD0, LOD1, LOD2, all"),
        ("usd", {"variants": {"LOD": "LOD1"}}, "keeps all variants"),
    ],
)
def test_wrong_options_are_told_and_leave_nothing(
    tree: Path, tmp_path: Path, profile: str, options: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message) as told:
        write_profile(tree, tmp_path / "made", profile, **options)  # type: ignore[arg-type]
    assert "\n" not in str(told.value)
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("profile", PROFILES)
def test_a_missing_texture_is_told_and_leaves_nothing(tree: Path, tmp_path: Path, profile: str) -> None:
    (tree / "textures" / "leaf.png").unlink()
    with pytest.raises(InputError, match=r"leaf\.png"):
        write_profile(tree, tmp_path / "made", profile)
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("profile", PROFILES)
def test_a_missing_layer_is_told_and_leaves_nothing(tree: Path, tmp_path: Path, profile: str) -> None:
    (tree / "geometry.usdc").unlink()
    with pytest.raises(InputError, match=r"geometry\.usdc"):
        write_profile(tree, tmp_path / "made", profile)
    assert not (tmp_path / "made").exists()


def test_what_is_no_tree_is_told(tree: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such folder"):
        write_profile(tmp_path / "gone", tmp_path / "made", "usd")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no scene; expected OUT/trees/NAME or OUT"):
        write_profile(tmp_path / "empty", tmp_path / "made", "usd")
    renamed = tree.rename(tree.with_name("my old oak"))
    with pytest.raises(InputError, match=r"must keep the tree's name: rename it to oak"):
        write_profile(renamed, tmp_path / "made", "usd")
    for profile in ("blender", "unreal"):
        with pytest.raises(InputError, match=r"oak\.usda: there is no tree in it; .* a folder keeps its tree's name"):
            write_profile(renamed / "oak.usda", tmp_path / "made", profile)
    with pytest.raises(InputError, match="is what the profile is made from"):
        write_profile(renamed.rename(tree), tree, "usd")
    assert not (tmp_path / "made").exists()


def test_a_failure_midway_leaves_what_was_there(tree: Path, tmp_path: Path) -> None:
    path = write_profile(tree, tmp_path / "made", "web")
    before = path.read_bytes()
    (tree / "textures" / "bark.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"bark\.png is no picture"):
        write_profile(tree, tmp_path / "made", "web")
    assert path.read_bytes() == before
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]
