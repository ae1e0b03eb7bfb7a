"""Paths of a manifest: relative to it, below the scene's root, links included."""

from __future__ import annotations

from pathlib import Path

import pytest

from forestgen.errors import InputError
from forestgen.scene.manifest import load_scene
from tests.scene.manifests import HEAD, TREE, load, with_tree, written


def test_without_marks_the_manifests_own_folder_is_the_root(tmp_path: Path, place_of_scene: Path) -> None:
    lonely = tmp_path / "lonely"
    lonely.mkdir()
    (lonely / "plane.png").write_bytes((place_of_scene / "photos" / "plane.png").read_bytes())
    manifest = written(
        lonely, with_tree('photo = "plane.png"', "photo").replace("../../stroke_sets", "../project/stroke_sets")
    )
    with pytest.raises(InputError, match=r"strokes: .* leads out of the scene's root"):
        load_scene(manifest)
    scene = load_scene(manifest, tmp_path)
    assert scene.root == tmp_path.resolve()
    assert scene.resolved()["tree"][0]["view"][0]["strokes"] == "project/stroke_sets/street/plane.json"


def test_a_root_must_hold_the_manifest(tmp_path: Path, place_of_scene: Path) -> None:
    manifest = written(place_of_scene, HEAD + TREE)
    with pytest.raises(InputError, match=r"--root .*photos: expected a folder that holds"):
        load_scene(manifest, place_of_scene / "photos")
    with pytest.raises(InputError, match=r"--root .*none: expected a folder, but there is none"):
        load_scene(manifest, tmp_path / "none")


def test_links_may_point_about_inside_the_root_and_not_out_of_it(tmp_path: Path, place_of_scene: Path) -> None:
    (place_of_scene / "inside.png").symlink_to(place_of_scene / "photos" / "plane.png")
    assert load(place_of_scene, with_tree('photo = "inside.png"', "photo")).trees
    (tmp_path / "secret.png").write_bytes((place_of_scene / "photos" / "plane.png").read_bytes())
    (place_of_scene / "outside.png").symlink_to(tmp_path / "secret.png")
    with pytest.raises(InputError, match=r"photo: 'outside\.png' leads out of the scene's root"):
        load(place_of_scene, with_tree('photo = "outside.png"', "photo"))
    (place_of_scene / "ring.png").symlink_to(place_of_scene / "ring.png")
    with pytest.raises(InputError, match=r"photo: 'ring\.png'"):
        load(place_of_scene, with_tree('photo = "ring.png"', "photo"))


def test_a_link_before_dots_is_followed_as_the_system_does(tmp_path: Path, place_of_scene: Path) -> None:
    deep = place_of_scene.parents[1] / "deep" / "down"
    deep.mkdir(parents=True)
    (deep.parent / "there.png").write_bytes((place_of_scene / "photos" / "plane.png").read_bytes())
    (place_of_scene / "link").symlink_to(deep)
    (tree,) = load(place_of_scene, with_tree('photo = "link/../there.png"', "photo")).trees
    assert tree.views[0].photo.samefile(deep.parent / "there.png")


def test_a_relative_manifest_path_works(place_of_scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(place_of_scene, HEAD + TREE)
    monkeypatch.chdir(place_of_scene)
    scene = load_scene(Path("scene.toml"))
    assert scene.trees[0].views[0].strokes.is_file()
    assert scene.resolved()["tree"][0]["view"][0]["photo"] == "scenes/street/photos/plane.png"


# Folders -------------------------------------------------------------------------------------------


def with_library(text: str) -> str:
    return with_tree(f"[tree.settings.grow]\nlibrary = {text}")


def test_a_library_is_found_from_the_manifest_wherever_one_stands(
    place_of_scene: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    library = place_of_scene.parents[1] / "subtrees"
    library.mkdir()
    monkeypatch.chdir(tmp_path)
    scene = load(place_of_scene, with_library('"../../subtrees"'))
    assert Path(scene.trees[0].method.grow.library).samefile(library)  # type: ignore[attr-defined]
    settings = scene.resolved()["tree"][0]["settings"]
    assert settings["grow"]["library"] == "subtrees"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('"none"', "'none': expected a folder, but there is none; check the path"),
        ('"photos/plane.png"', "expected a folder, but there is none"),
        ('"../../../other"', r"'\.\./\.\./\.\./other' leads out of the scene's root"),
        ('"/etc"', "expected a path relative to the manifest, came '/etc'"),
        (f'"{"x" * 5000}"', "expected a folder, but there is none"),
        ("3", "Input should be a valid string; came 3"),
    ],
)
def test_a_library_that_is_no_folder_below_the_root_is_refused(place_of_scene: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=rf"tree\[1\] 'plane_01': settings\.grow\.library: .*{message}"):
        load(place_of_scene, with_library(text))


def test_a_library_may_not_be_a_link_out_of_the_root(place_of_scene: Path, tmp_path: Path) -> None:
    (tmp_path / "secret").mkdir()
    (place_of_scene / "library").symlink_to(tmp_path / "secret")
    with pytest.raises(InputError, match="leads out of the scene's root"):
        load(place_of_scene, with_library('"library"'))
