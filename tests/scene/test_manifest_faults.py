"""Faults in manifests: whatever is wrong is one line with file, key, what was expected, and a remedy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from forestgen.errors import InputError
from forestgen.scene.manifest import load_scene
from tests.scene.manifests import HEAD, TREE, WHOLE, load, with_tree

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
