"""A small scene built for real: what is written, what is reported, and that a check alone agrees."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace

import pytest

from forestgen import pipeline
from forestgen.pipeline import build_model, build_scene, check_output, tree_names, write_tree
from forestgen.scene.manifest import load_scene
from tests.small_scene import defeating_strokes, digests, write_scene


@pytest.fixture(scope="module")
def built(inputs, tmp_path_factory):
    """One tree built and a copy of it, and a tree that defeats a stage; (folder, report, progress)."""
    folder = tmp_path_factory.mktemp("built")
    for name in ("photo.png", "strokes.json"):
        shutil.copy(inputs / name, folder)
    bad = f'[[tree]]\nname = "hopeless"\nheight = 5\nphoto = "photo.png"\nstrokes = "{defeating_strokes(folder)}"\n'
    copies = '[[copy]]\nof = "Söhne 1"\nposition = [0, 0, 9]\n[[copy]]\nof = "hopeless"\nposition = [0, 0, 18]\n'
    heard = []
    scene = load_scene(write_scene(folder, "Söhne 1", extra=bad + copies))
    report = build_scene(scene, folder / "deep" / "out", on_progress=lambda *what: heard.append(what))
    return folder / "deep" / "out", report, heard


@pytest.mark.gl
def test_a_tree_that_defeats_a_stage_is_named_and_the_other_stands(built):
    out, report, _ = built
    good, bad = report["trees"]
    assert good["name"] == "Söhne 1"
    assert good["views"]
    assert "background" in bad["error"]
    assert not report["passed"]
    assert sorted(path.name for path in (out / "trees").iterdir()) == ["Sohne_1"]


@pytest.mark.gl
def test_output_is_as_the_design_says_and_nothing_else(built):
    out, _, _ = built
    assert {path.name for path in out.iterdir()} == {
        "small.usda",
        "trees",
        "build.json",
        "seconds.json",
        "report.json",
        "report.html",
        "report",
    }
    tree = out / "trees" / "Sohne_1"
    assert {"Sohne_1.usda", "textures", "reference", "cameras.usda"} <= {path.name for path in tree.iterdir()}
    assert (tree / "reference" / "view_00" / "photo.png").is_file()
    assert not list(out.rglob(".*"))


@pytest.mark.gl
def test_the_stage_places_the_tree_and_its_copy_but_no_failed_one(built):
    from forestgen.usd.layers import open_stage

    out, _, _ = built
    stage = open_stage(out / "small.usda")
    roots = [prim for prim in stage.Traverse() if prim.IsInstance() and prim.GetMetadata("kind") == "component"]
    assert len(roots) == 2


@pytest.mark.gl
def test_the_report_tells_the_seconds_of_every_stage(built):
    _, report, _ = built
    assert set(report["trees"][0]["seconds"]) == set(pipeline.STEPS)
    assert all(spent >= 0 for spent in report["trees"][0]["seconds"].values())
    assert report["trees"][1]["seconds"] == {}


@pytest.mark.gl
def test_progress_goes_through_the_stages_in_order_and_ends_once_a_tree(built):
    _, _, heard = built
    for index in (0, 1):
        assert [what for what in heard if what[0] == index][-1] == (index, "", 1, 1)
        assert sum(what[:2] == (index, "") for what in heard) == 1
    stages = [stage for index, stage, _, _ in heard if index == 0 and stage]
    assert set(stages) == set(pipeline.STEPS)
    assert stages[-1] == "check"
    assert any(total for _, stage, _, total in heard if stage == "grow")


@pytest.mark.gl
def test_build_json_holds_the_manifest_resolved_and_no_path_of_this_machine(built):
    out, _, _ = built
    text = (out / "build.json").read_text()
    record = json.loads(text)
    assert record["scene"] == {"name": "small", "seed": 7, "prim_name": "small"}
    assert [tree["prim_name"] for tree in record["trees"]] == ["Sohne_1", "hopeless"]
    assert record["tree"][0]["settings"]["grow"]["iterations"] == 3
    assert record["tree"][0]["view"][0]["photo"] == "photo.png"
    assert str(out.parent.parent) not in text
    assert not any(word in text for word in ("seconds", os.path.expanduser("~/")))


@pytest.mark.gl
def test_no_file_names_a_path_of_this_machine(built):
    out, _, _ = built
    folder = str(out.parent.parent).encode()
    for path in out.rglob("*"):
        assert path.is_dir() or folder not in path.read_bytes(), path


@pytest.mark.gl
def test_a_check_alone_gives_the_same_report(built):
    out, report, _ = built
    before = digests(out)

    def timeless(content):
        return {**content, "trees": [{**tree, "seconds": sorted(tree["seconds"])} for tree in content["trees"]]}

    assert timeless(check_output(out)) == timeless(report)
    after = digests(out)
    assert {name for name in before if before[name] != after.get(name)} <= {"report.json", "report.html"}
    assert before.keys() == after.keys()
    assert tree_names(out) == ["Söhne 1", "hopeless"]


def test_a_model_can_be_built_and_written_by_itself(folder):
    scene = load_scene(write_scene(folder, "one"))
    model = build_model(scene.trees[0])
    assert model.name == "one"
    written = write_tree(model, "one", folder / "trees")
    assert written == folder / "trees" / "one"
    first = digests(written)
    assert f"{written.name}.usda" in first
    assert digests(write_tree(model, "one", folder / "trees")) == first  # over the earlier one
    assert [path.name for path in (folder / "trees").iterdir()] == ["one"]
    (folder / "trees" / "one" / "mark").touch()
    with pytest.raises(RuntimeError, match="no more"):
        write_tree(replace(model, views=Exploding()), "one", folder / "trees")
    assert digests(written).keys() == {*first, "mark"}
    assert [path.name for path in (folder / "trees").iterdir()] == ["one"]


class Exploding(tuple):
    def __iter__(self):
        raise RuntimeError("no more")
