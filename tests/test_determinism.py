"""Same scene, same bytes: whatever the number of workers, wherever the output lies, however often it is built."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from forestgen.pipeline import build_model, build_scene
from forestgen.scene.manifest import load_scene
from tests.small_scene import digests, write_scene
from tests.synthetic import drawn_tree

TIMED = {"seconds.json", "report.json", "report.html"}  # hold how long stages took


@pytest.fixture(scope="module")
def outs(tmp_path_factory) -> tuple[Path, Path]:
    """The same scene built alone, and by two workers in another place."""
    made = []
    for jobs in (1, 2):
        folder = tmp_path_factory.mktemp(f"jobs_{jobs}")
        write_scene(folder, "a", "b", extra='[[copy]]\nof = "b"\nposition = [0, 0, 9]\n')
        build_scene(load_scene(folder / "scene.toml"), folder / "out", jobs=jobs)
        made.append(folder / "out")
    return made[0], made[1]


@pytest.mark.gl
def test_layers_textures_and_pictures_are_the_same_to_the_byte(outs):
    one, two = (digests(out) for out in outs)
    assert one.keys() == two.keys()
    assert {name for name in one if one[name] != two[name]} <= TIMED
    assert {"build.json", "small.usda", "trees/a/a.usda"} <= one.keys()


@pytest.mark.gl
def test_reports_are_the_same_but_for_the_seconds(outs):
    def timeless(out):
        report = json.loads((out / "report.json").read_text())
        return {**report, "trees": [{**tree, "seconds": sorted(tree["seconds"])} for tree in report["trees"]]}

    assert timeless(outs[0]) == timeless(outs[1])


@pytest.mark.gl
def test_trees_of_one_photo_and_two_seeds_differ(outs):
    a, b = (digests(outs[0] / "trees" / name) for name in "ab")
    assert a["reference/skeleton.npz"] != b["reference/skeleton.npz"]
    assert a["reference/view_00/photo.png"] == b["reference/view_00/photo.png"]


def test_a_model_does_not_depend_on_what_was_built_before(tmp_path):
    """Global state of numpy, OpenCV and the like is neither used nor left."""
    import cv2
    import numpy as np

    scene = load_scene(write_scene(tmp_path, "a", "b"))
    first = build_model(scene.trees[0])
    build_model(scene.trees[1])
    np.random.seed(5)  # noqa: NPY002 - on purpose
    cv2.setRNGSeed(5)
    state = np.random.get_state()[1].copy()  # noqa: NPY002
    again = build_model(scene.trees[0])
    assert (np.random.get_state()[1] == state).all()  # noqa: NPY002
    for part in ("skeleton", "mesh", "leaves", "bark", "atlas"):
        for name, value in vars(getattr(first, part)).items():
            if isinstance(value, np.ndarray):
                np.testing.assert_array_equal(value, getattr(getattr(again, part), name), f"{part}.{name}")


def test_the_test_tree_itself_is_the_same_each_time():
    assert (drawn_tree().photo.rgb == drawn_tree().photo.rgb).all()
