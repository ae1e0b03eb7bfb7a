"""Manifests: what the format promises is read, and everything else is one line with a remedy."""

from __future__ import annotations

import json
import math
import re
import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from forestgen.errors import InputError
from forestgen.scene.manifest import Scene, load_scene, single_tree_scene
from forestgen.tree.methods import METHODS, configure

TREE = """
[[tree]]
name = "plane_01"
height = 11.5
photo = "photos/plane.png"
strokes = "../../stroke_sets/street/plane.json"
"""

WHOLE = """
[scene]
name = "street"
seed = 7
method = "tan2008"
[scene.gates]
skill = 0.4
boundary_f = 0.8
""" + TREE + """
position = [1, 0.0, -2.5]
heading = 90
[tree.settings.grow]
iterations = 150
[tree.gates]
skill = 0.3

[[tree]]
name = "Eiche 🌳"
method = "tan2008_paper"
height = 9
seed = 99
[[tree.view]]
photo = "photos/oak_front.png"
strokes = "../../stroke_sets/street/oak_front.json"
[[tree.view]]
photo = "photos/oak_side.png"
strokes = "../../stroke_sets/street/oak_side.json"
azimuth = 90
elevation = -5.0
scale = 1.1
root = [50, 76.5]
focal_px = 1400

[[copy]]
of = "plane_01"
position = [8.0, 0.0, 0.0]
heading = 120.0
scale = 0.9
"""  # fmt: skip

HEAD = '[scene]\nname = "street"\n'


def written(folder: Path, text: str, name: str = "scene.toml") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def load(folder: Path, text: str) -> Scene:
    return load_scene(written(folder, text))


def with_tree(change: str, key: str = "") -> str:
    """A manifest of one tree with a line added, or with that of `key` replaced by it."""
    kept = [line for line in TREE.splitlines() if not (key and line.startswith(key))]
    return "\n".join([HEAD, *kept, change]) + "\n"


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
    assert (oak.name, oak.prim_name, oak.seed, oak.method_name) == ("Eiche 🌳", "Eiche", 99, "tan2008_paper")
    assert oak.method == METHODS["tan2008_paper"]
    assert oak.gates == {"skill": 0.4, "boundary_f": 0.8}
    side = oak.views[1]
    assert side.azimuth == pytest.approx(math.pi / 2)
    assert side.elevation == pytest.approx(math.radians(-5))
    assert (side.scale, side.root, side.focal_px) == (1.1, (50.0, 76.5), 1400.0)
    assert (scene.copies[0].of, scene.copies[0].scale) == ("plane_01", 0.9)
    assert scene.copies[0].heading == pytest.approx(math.radians(120))


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
    assert resolved["tree"][1]["settings"] == {k: asdict(v) for k, v in vars(METHODS["tan2008_paper"]).items()}


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


# What is refused -----------------------------------------------------------------------------------

REFUSED: dict[str, tuple[str, str]] = {
    "no toml": ("[scene\n", r"not valid TOML: .*\(at line 1, column 7\)"),
    "no scene": (TREE, r"scene is missing: expected a table \[scene\] with at least a name"),
    "scene no table": ("scene = 3\n", r"scene: expected a table \[scene\] .* came 3"),
    "no name": ("[scene]\n" + TREE, "scene.name is missing: expected a name in quotes"),
    "blank name": ('[scene]\nname = " "\n' + TREE, "scene.name: expected a name in quotes"),
    "control name": (with_tree('name = "a\\u0007b"', "name"), r"tree\[1\] 'a b': name: expected a name"),
    "no tree": (HEAD, r"the scene has no tree; add a \[\[tree\]\] with name, height, photo and strokes"),
    "tree single": (HEAD + TREE.replace("[[tree]]", "[tree]"), r"tree: expected one table a tree, in double brackets"),
    "trees": (HEAD + TREE.replace("[[tree]]", "[[trees]]"), r"unknown key 'trees'; did you mean 'tree'\?"),
    "seed text": (
        '[scene]\nname = "s"\nseed = "7"\n' + TREE,
        "scene.seed: expected a whole number, 0 or more, came '7'",
    ),
    "seed negative": (
        '[scene]\nname = "s"\nseed = -1\n' + TREE,
        "scene.seed: expected a whole number, 0 or more, came -1",
    ),
    "seed vast": (f'[scene]\nname = "s"\nseed = {10**30}\n' + TREE, "scene.seed: expected a whole number"),
    "method": (
        '[scene]\nname = "s"\nmethod = "tan208"\n' + TREE,
        "scene.method: unknown method 'tan208'; did you mean",
    ),
    "tree method": (with_tree('method = "x"'), r"tree\[1\] 'plane_01': unknown method 'x'"),
    "unknown key": (with_tree("heigth = 3"), r"tree\[1\] 'plane_01': unknown key 'heigth'; did you mean 'height'\?"),
    "unknown far key": (with_tree("zz = 3"), r"tree\[1\] 'plane_01': unknown key 'zz'; known: name, height, photo"),
    "view's key": (
        with_tree("focal_px = 1400"),
        r"'plane_01': unknown key 'focal_px'; it belongs in the table 'view'",
    ),
    "misspelled": (with_tree("heigth = 3", "height"), r"unknown key 'heigth'; did you mean 'height'\? \(and 1 more"),
    "scene's key": ('name = "street"\n' + TREE, r"unknown key 'name'; it belongs in the table 'scene'"),
    "height missing": (with_tree("", "height"), r"tree\[1\] 'plane_01': height is missing: expected metres"),
    "height text": (with_tree('height = "tall"', "height"), r"height: expected metres from the root .* came 'tall'"),
    "height zero": (with_tree("height = 0", "height"), "height: expected .* came 0"),
    "height negative": (with_tree("height = -3.5", "height"), "height: expected .* came -3.5"),
    "height nan": (with_tree("height = nan", "height"), "height: expected .* came nan"),
    "height infinite": (with_tree("height = inf", "height"), "height: expected .* came inf"),
    "height in cm": (with_tree("height = 1150", "height"), "height: expected metres .* 0.01 to 1000, came 1150"),
    "height true": (with_tree("height = true", "height"), "height: expected .* came True"),
    "height date": (with_tree("height = 2020-01-01", "height"), "height: expected .* came datetime"),
    "name number": (with_tree("name = 3", "name"), r"tree\[1\]\.name: expected a name in quotes.* came 3"),
    "name missing": (with_tree("", "name"), r"tree\[1\]\.name is missing"),
    "position 2": (with_tree("position = [1, 2]"), r"'plane_01': position: expected three numbers .* came \[1, 2\]"),
    "position text": (with_tree('position = [1, "2", 3]'), r"position\[2\]: expected three numbers .* came '2'"),
    "position nan": (with_tree("position = [1, nan, 3]"), r"position\[2\]: expected three numbers .* came nan"),
    "heading": (with_tree('heading = "N"'), r"heading: expected degrees about \+Y, a number, came 'N'"),
    "no photo": (with_tree("", "photo"), r"tree\[1\] 'plane_01': photo is missing: expected photo and strokes, or one"),
    "no strokes": (with_tree("", "strokes"), r"tree\[1\] 'plane_01': strokes is missing"),
    "both": (
        with_tree('[[tree.view]]\nphoto = "a"\nstrokes = "b"'),
        r"has both a photo of its own and \[\[tree.view\]\]",
    ),
    "view key": (
        HEAD + '[[tree]]\nname = "a"\nheight = 3\n[[tree.view]]\nphoto = "a"\nstrokes = "b"\nazimut = 3\n',
        r"tree\[1\] 'a': view\[1\]: unknown key 'azimut'; did you mean 'azimuth'\?",
    ),
    "view missing": (
        HEAD + '[[tree]]\nname = "a"\nheight = 3\n[[tree.view]]\nphoto = "photos/plane.png"\n',
        r"tree\[1\] 'a': view\[1\]\.strokes is missing: expected the stroke set's path",
    ),
    "view file": (
        HEAD + '[[tree]]\nname = "a"\nheight = 3\n[[tree.view]]\nphoto = "photos/none.png"\nstrokes = "b"\n',
        r"tree\[1\] 'a': view\[1\]\.photo: 'photos/none\.png': expected a photo, but there is no such file; check",
    ),
    "elevation": (
        HEAD + '[[tree]]\nname = "a"\nheight = 3\n[[tree.view]]\nphoto = "a"\nstrokes = "b"\nelevation = 91\n',
        r"view\[1\]\.elevation: expected degrees above the horizon, -90 to 90, came 91",
    ),
    "photo missing": (
        with_tree('photo = "photos/none.png"', "photo"),
        r"tree\[1\] 'plane_01': photo: 'photos/none\.png': expected a photo, but there is no such file; ch",
    ),
    "photo folder": (
        with_tree('photo = "photos"', "photo"),
        r"photo: 'photos': expected a photo, but this is a folder",
    ),
    "photo backslash": (with_tree("photo = 'photos\\plane.png'", "photo"), "write paths with forward slashes"),
    "photo empty": (with_tree('photo = ""', "photo"), "photo: expected a path relative to the manifest, came ''"),
    "photo long": (with_tree(f'photo = "{"x" * 5000}"', "photo"), "photo: 'xxx"),
    "photo zero": (with_tree('photo = "a\\u0000b"', "photo"), "holds a zero character"),
    "photo absolute": (
        with_tree('photo = "/etc/passwd"', "photo"),
        "photo: expected a path relative to the manifest, came",
    ),
    "photo drive": (with_tree(r"photo = 'C:\a.png'", "photo"), "photo: expected a path relative to the manifest, came"),
    "photo above": (
        with_tree('photo = "../../../other/a.png"', "photo"),
        "photo: '../../../other/a.png' leads out of the scene's root .*; move the file below it, or widen",
    ),
    "photo above and back": (
        with_tree('photo = "../../../project/scenes/street/photos/plane.png"', "photo"),
        "leads out of",
    ),
    "duplicate": (HEAD + TREE + TREE, r"tree\[2\] 'plane_01': name: tree\[1\] has the same; rename one"),
    "copy of none": (
        with_tree('[[copy]]\nof = "plane_1"\nposition = [0, 0, 0]'),
        r"copy\[1\]\.of: no tree is named 'plane_1'; did you mean 'plane_01'\?",
    ),
    "copy nowhere": (with_tree('[[copy]]\nof = "plane_01"'), r"copy\[1\]\.position is missing: expected three numbers"),
    "copy scale": (
        with_tree('[[copy]]\nof = "plane_01"\nposition = [0, 0, 0]\nscale = 0'),
        r"copy\[1\]\.scale: expected a number above 0",
    ),
    "copy key": (
        with_tree('[[copy]]\nof = "plane_01"\nposition = [0, 0, 0]\nyaw = 0'),
        r"copy\[1\]: unknown key 'yaw'; known: of, position, heading, scale",
    ),
    "scatter": (
        with_tree('[[scatter]]\nof = ["plane_01"]\ncount = 1000'),
        r"\[\[scatter\]\] is not built yet; place trees with",
    ),
    "gate name": (
        with_tree("[tree.gates]\nskil = 0.4"),
        r"tree\[1\] 'plane_01': gates: unknown key 'skil'; did you mean 'skill'\?",
    ),
    "gate value": (
        with_tree("[tree.gates]\nbranch_chamfer = 1.5"),
        r"gates\.branch_chamfer: expected the most that passes, as a share of .* 0.015 for 1.5 %, came 1.5",
    ),
    "scene gate": (
        '[scene]\nname = "s"\n[scene.gates]\nskill = "high"\n' + TREE,
        "scene.gates.skill: expected the least that passes, -1 to 1, came 'high'",
    ),
    "stage": (
        with_tree('[tree.stages]\nsegmnt = "graph_cut"'),
        r"tree\[1\] 'plane_01': unknown stage 'segmnt'; did you mean 'segment'",
    ),
    "strategy": (
        with_tree('[tree.stages]\nsegment = "graph_cat"'),
        r"tree\[1\] 'plane_01': unknown strategy .* 'graph_cat'; did you mean 'graph_cut'",
    ),
    "setting stage": (
        with_tree("[tree.settings.groww]\niterations = 1"),
        r"tree\[1\] 'plane_01': unknown stage 'groww'; did you mean 'grow'",
    ),
    "setting": (
        with_tree("[tree.settings.grow]\niteration = 1"),
        r"tree\[1\] 'plane_01': unknown setting of stage 'grow' 'iteration'; did you mean 'iterations'",
    ),
    "setting type": (
        with_tree('[tree.settings.grow]\niterations = "many"'),
        r"tree\[1\] 'plane_01': settings.grow.iterations: .* 'many'",
    ),
    "settings flat": (
        with_tree("[tree.settings]\niterations = 1"),
        r"settings\.iterations: expected tables \[tree.settings.STAGE\]",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_wrong_is_said_in_one_line(place_of_scene: Path, name: str) -> None:
    text, message = REFUSED[name]
    with pytest.raises(InputError, match=message) as caught:
        load(place_of_scene, text)
    assert str(caught.value).startswith(f"{place_of_scene / 'scene.toml'}: ")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 600


def test_further_faults_are_counted(place_of_scene: Path) -> None:
    with pytest.raises(InputError, match=r"height: expected .* came -1 \(and 2 more faults\)"):
        load(place_of_scene, with_tree("height = -1\nheading = true\nseed = 1.5", "height"))


def test_a_manifest_that_is_no_text_or_not_there(place_of_scene: Path) -> None:
    (place_of_scene / "latin.toml").write_bytes('[scene]\nname = "Allee für"\n'.encode("latin-1"))
    with pytest.raises(InputError, match="is not UTF-8; save the file as UTF-8"):
        load_scene(place_of_scene / "latin.toml")
    with pytest.raises(InputError, match=r"expected a scene manifest \(TOML\), but there is no such file"):
        load_scene(place_of_scene / "none.toml")
    with pytest.raises(InputError, match="but this is a folder"):
        load_scene(place_of_scene)


@pytest.mark.parametrize("name", ["old oak", "3rd", "🌳", "x" * 300, "a.b/c", "Straße <b>", "con"])
def test_odd_names_are_welcome(place_of_scene: Path, name: str) -> None:
    (tree,) = load(place_of_scene, with_tree(f"name = {json.dumps(name, ensure_ascii=False)}", "name")).trees
    assert tree.name == name
    assert re.fullmatch(r"[A-Za-z_]\w{0,63}", tree.prim_name, re.ASCII)


# The root ------------------------------------------------------------------------------------------


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


# Attack --------------------------------------------------------------------------------------------

PIECES = [
    "[",
    "]",
    "=",
    '"',
    "\n",
    "-1",
    "inf",
    "nan",
    "true",
    "{}",
    "[[1]]",
    "1979-05-27",
    "0x1F",
    "tree",
    "9" * 25,
    "'",
]


def spoiled(text: str, rng: np.random.Generator) -> str:
    """A text with one line dropped, doubled, or written over in part or after its equals sign."""
    lines = text.splitlines()
    at = int(rng.integers(len(lines)))
    line, piece = lines[at], PIECES[rng.integers(len(PIECES))]
    cut = int(rng.integers(len(line) + 1))
    lines[at : at + 1] = [
        [],
        [line, line],
        [line[:cut] + piece + line[cut + int(rng.integers(4)) :]],
        [line.split("=")[0] + "= " + piece if "=" in line else line],
    ][rng.integers(4)]
    return "\n".join(lines)


def test_mutated_manifests_give_a_scene_or_an_input_error(place_of_scene: Path) -> None:
    rng = np.random.default_rng(4)
    for _ in range(400):
        text = WHOLE
        for _ in range(rng.integers(1, 4)):
            text = spoiled(text, rng)
        message = ""
        try:
            assert load(place_of_scene, text).trees
        except InputError as error:
            message = str(error)
        assert "\n" not in message


@settings(deadline=None, max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=120))
def test_random_bytes_give_an_input_error(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.toml").write_bytes(content)
    with pytest.raises(InputError):
        load_scene(tmp_path / "x.toml")


def test_the_whole_manifest_is_valid_toml() -> None:
    assert len(tomllib.loads(WHOLE)["tree"]) == 2
