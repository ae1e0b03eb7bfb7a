"""Manifests: what the format promises is read, and written down again as resolved."""

from __future__ import annotations

import json
import math
import re
import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from forestgen.errors import InputError
from forestgen.scene.manifest import load_scene, single_tree_scene
from forestgen.tree.methods import METHODS, configure
from tests.scene.manifests import MANY_VIEWS, TREE, WHOLE, load, with_tree, written


def test_the_whole_format(place_of_scene: Path) -> None:
    scene = load(place_of_scene, WHOLE)
    assert (scene.name, scene.prim_name, scene.seed) == ("street", "street", 7)
    assert scene.root == place_of_scene.parents[1].resolve()
    plane, oak = scene.trees
    assert (plane.name, plane.prim_name, plane.height, plane.seed) == ("plane_01", "plane_01", 11.5, 7)
    assert plane.position == (1.0, 0.0, -2.5)
    assert plane.heading == pytest.approx(math.pi / 2)
    assert plane.gates == {"skill": 0.3, "boundary_f": 0.8}
    assert plane.method == configure("tan2008", {}, {"grow": {"iterations": 150}})
    assert plane.method != METHODS["tan2008"]
    assert len(plane.views) == 1
    assert plane.views[0].photo.samefile(place_of_scene / "photos" / "plane.png")
    assert plane.views[0].strokes.samefile(place_of_scene / "../../stroke_sets/street/plane.json")
    assert (plane.views[0].azimuth, plane.views[0].scale, plane.views[0].root) == (0.0, 1.0, None)
    assert (oak.name, oak.prim_name, oak.seed, oak.method_name) == ("Eiche 🌳", "Eiche", 99, MANY_VIEWS)
    assert oak.method == METHODS[MANY_VIEWS]
    assert oak.gates == {"skill": 0.4, "boundary_f": 0.8}
    side = oak.views[1]
    assert side.azimuth == pytest.approx(math.pi / 2)
    assert side.elevation == pytest.approx(math.radians(-5))
    assert (side.scale, side.root, side.focal_px) == (1.1, (50.0, 76.5), 1400.0)
    assert (scene.copies[0].of, scene.copies[0].scale) == ("plane_01", 0.9)
    assert scene.copies[0].heading == pytest.approx(math.radians(120))


@pytest.mark.parametrize("name", ["old oak", "3rd", "🌳", "x" * 300, "a.b/c", "Straße <b>", "con"])
def test_odd_names_are_welcome(place_of_scene: Path, name: str) -> None:
    (tree,) = load(place_of_scene, with_tree(f"name = {json.dumps(name, ensure_ascii=False)}", "name")).trees
    assert tree.name == name
    assert re.fullmatch(r"[A-Za-z_]\w{0,63}", tree.prim_name, re.ASCII)


def test_the_whole_manifest_is_valid_toml() -> None:
    assert len(tomllib.loads(WHOLE)["tree"]) == 2


def test_trees_take_the_scenes_seed_and_their_place_in_it(place_of_scene: Path) -> None:
    second = TREE.replace("plane_01", "plane_02")
    scene = load(place_of_scene, '[scene]\nname = "s"\nseed = 40\n' + TREE + second)
    assert [tree.seed for tree in scene.trees] == [40, 41]


def test_the_sample_scenes_load(scenes: Path) -> None:
    for path in sorted(scenes.glob("*/scene.toml")):
        assert load_scene(path).trees


def test_the_shared_manifests_load(shared: Path) -> None:
    counts = {path.stem: len(load_scene(path).trees) for path in (shared / "photos").glob("*.toml")}
    assert counts == {"street": 9, "woods": 4, "roadside": 4}


# resolved ------------------------------------------------------------------------------------------


def as_toml(table: dict[str, Any], prefix: str = "") -> str:
    """Plain TOML of nested tables."""
    nested = {
        k for k, v in table.items() if isinstance(v, dict) or (isinstance(v, list) and v and isinstance(v[0], dict))
    }
    plain = {key: value for key, value in table.items() if key not in nested}
    text = "".join(f"{key} = {json.dumps(value, ensure_ascii=False)}\n" for key, value in plain.items())
    for key, value in table.items():
        if isinstance(value, dict) and value:
            text += f"[{prefix}{key}]\n" + as_toml(value, f"{prefix}{key}.")
        elif key not in plain and isinstance(value, list):
            text += "".join(f"[[{prefix}{key}]]\n" + as_toml(one, f"{prefix}{key}.") for one in value)
    return text


def test_resolved_is_json_with_relative_paths_only(place_of_scene: Path) -> None:
    resolved = load(place_of_scene, WHOLE).resolved()
    text = json.dumps(resolved)
    assert str(place_of_scene.parents[2]) not in text
    assert resolved["tree"][0]["view"][0]["photo"] == "scenes/street/photos/plane.png"
    assert resolved["tree"][0]["view"][0]["strokes"] == "stroke_sets/street/plane.json"
    assert resolved["tree"][0]["heading"] == 90
    assert resolved["tree"][0]["settings"]["grow"]["iterations"] == 150
    assert resolved["tree"][1]["settings"] == {k: asdict(v) for k, v in vars(METHODS[MANY_VIEWS]).items()}


def test_resolved_is_a_manifest_that_resolves_to_itself(place_of_scene: Path) -> None:
    resolved = load(place_of_scene, WHOLE).resolved()
    again = load_scene(written(place_of_scene.parents[1], as_toml(resolved), "again.toml"))
    assert again.resolved() == resolved


def test_resolved_of_a_loose_photo_tells_nothing_of_the_folders(tmp_path: Path, place_of_scene: Path) -> None:
    scene = single_tree_scene(
        place_of_scene / "photos" / "plane.png", place_of_scene.parents[1] / "stroke_sets" / "street" / "plane.json"
    )
    view = scene.resolved()["tree"][0]["view"][0]
    assert (view["photo"], view["strokes"]) == ("plane.png", "plane.json")


# One tree ------------------------------------------------------------------------------------------


def test_a_scene_of_one_tree(place_of_scene: Path) -> None:
    photo = place_of_scene / "photos" / "plane.png"
    strokes = place_of_scene.parents[1] / "stroke_sets" / "street" / "plane.json"
    scene = single_tree_scene(photo, strokes, height=7.5, seed=3)
    (tree,) = scene.trees
    assert (scene.name, tree.name, tree.height, tree.seed) == ("plane", "plane", 7.5, 3)
    assert tree.position == (0.0, 0.0, 0.0)
    assert tree.method == METHODS["tan2008"]
    assert single_tree_scene(photo, strokes).trees[0].height == 10.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"height": 0.0}, r"height: expected metres from the root to the crown's top, .* came 0.0"),
        ({"height": math.nan}, "height: expected .* came nan"),
        ({"seed": -1}, "seed: expected a whole number, 0 or more, came -1"),
        ({"method": "tan2009"}, "method: unknown method 'tan2009'; did you mean 'tan2008'"),
    ],
)
def test_a_scene_of_one_tree_checks_its_options(place_of_scene: Path, options: Any, message: str) -> None:
    photo = place_of_scene / "photos" / "plane.png"
    strokes = place_of_scene.parents[1] / "stroke_sets" / "street" / "plane.json"
    with pytest.raises(InputError, match=message):
        single_tree_scene(photo, strokes, **options)


def test_a_scene_of_one_tree_names_the_file_that_is_missing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.jpg: expected a photo, but there is no such file"):
        single_tree_scene(tmp_path / "none.jpg", tmp_path / "none.json")
