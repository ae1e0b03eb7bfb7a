"""What a build refuses, what it removes, and what stays when something goes wrong; with pretended trees."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from forestgen import pipeline
from forestgen.errors import InputError, RenderError
from forestgen.pipeline import build_scene, check_inputs, check_output, tree_names
from forestgen.scene.manifest import load_scene
from tests.pipeline.pretended import build
from tests.small_scene import digests, write_scene
from tests.synthetic import drawn_tree


def test_trees_that_the_scene_no_longer_names_go_and_strange_files_stay(folder, pretend):
    build(folder, "a", "b", "c")
    out = folder / "out"
    (out / "trees" / "mine").mkdir()
    (out / "trees" / "mine" / "note.txt").write_text("not from a build")
    (out / "notes.txt").write_text("mine too")
    build(folder, "b", "d")
    assert {path.name for path in (out / "trees").iterdir()} == {"b", "d", "mine"}
    assert (out / "notes.txt").is_file()
    assert [tree["name"] for tree in json.loads((out / "report.json").read_text())["trees"]] == ["b", "d"]
    assert sorted(path.name for path in (out / "report").iterdir()) == ["b", "d"]
    assert not list(out.glob(".*"))


def test_the_stage_of_a_renamed_scene_goes(folder, pretend):
    build(folder, "a")
    path = folder / "scene.toml"
    path.write_text(path.read_text().replace('"small"', '"other"'))
    build_scene(load_scene(path), folder / "out")
    assert [path.name for path in (folder / "out").glob("*.usda")] == ["other.usda"]


def test_places_of_many_trees_come_and_go_with_the_stage(folder, pretend):
    build(folder, "a", instancing="points")
    assert (folder / "out" / "small_trees.usdc").is_file()
    build(folder, "a")
    assert not (folder / "out" / "small_trees.usdc").exists()


def test_an_unknown_kind_of_instancing_is_refused_before_anything_is_written(folder, pretend):
    with pytest.raises(InputError, match="expected one of auto, native, points, came 'prims'"):
        build(folder, "a", instancing="prims")
    assert not (folder / "out").exists()


def test_a_build_record_cannot_make_us_remove_other_folders(folder, pretend):
    build(folder, "a")
    victim = folder / "victim"
    victim.mkdir()
    (victim / "precious").touch()
    record = json.loads((folder / "out" / "build.json").read_text())
    record["trees"] += [{"name": "x", "prim_name": "../../victim"}, {"name": "y", "prim_name": ".."}]
    record["scene"]["prim_name"] = "../victim/precious"
    (folder / "out" / "build.json").write_text(json.dumps(record))
    build(folder, "b")
    assert (victim / "precious").is_file()
    assert [path.name for path in (folder / "out" / "trees").iterdir()] == ["b"]


@pytest.mark.parametrize("record", ["", "[]", '{"trees": 3}', '{"trees": [{"prim_name": 4}], "scene": []}'])
def test_a_broken_record_of_an_earlier_build_hinders_nothing(folder, pretend, record):
    build(folder, "a")
    (folder / "out" / "build.json").write_text(record)
    build(folder, "b")
    assert {path.name for path in (folder / "out" / "trees").iterdir()} == {"a", "b"}


def test_what_no_build_wrote_is_not_overwritten(folder, pretend):
    mine = folder / "out" / "trees" / "a"
    mine.mkdir(parents=True)
    (mine / "photo.jpg").write_text("mine")
    with pytest.raises(InputError, match="no build wrote it"):
        build(folder, "a")
    assert digests(folder / "out").keys() == {"trees/a/photo.jpg"}


def test_an_output_that_is_a_file_is_refused(folder, pretend):
    (folder / "out").write_text("a file")
    with pytest.raises(InputError, match="is a file"):
        build(folder, "a")
    assert (folder / "out").read_text() == "a file"


def spoil(folder: Path, what: str) -> None:
    """Spoil the inputs of the second tree."""
    text = (folder / "scene.toml").read_text()
    head, second = text.split('name = "b"')
    if what == "photo":
        (folder / "cut.png").write_bytes((folder / "photo.png").read_bytes()[:2000])
        second = second.replace('"photo.png"', '"cut.png"')
    elif what == "strokes":
        (folder / "outside.json").write_text((folder / "strokes.json").read_text().replace("[[", "[[-99999, 3], [", 1))
        second = second.replace('"strokes.json"', '"outside.json"')
    else:
        second = second.replace('photo = "photo.png"\nstrokes = "strokes.json"\n', "")
        second += '[[tree.view]]\nphoto = "photo.png"\nstrokes = "strokes.json"\nroot = [5, 99999]\n'
    (folder / "scene.toml").write_text(f'{head}name = "b"{second}')


@pytest.mark.parametrize("what", ["photo", "strokes", "root"])
def test_all_inputs_are_read_before_anything_is_written(folder, pretend, what):
    write_scene(folder, "a", "b")
    spoil(folder, what)
    with pytest.raises(InputError) as caught:
        build_scene(load_scene(folder / "scene.toml"), folder / "out")
    assert {"photo": "cut.png", "strokes": "outside.json", "root": "'b': root"}[what] in str(caught.value)
    assert not (folder / "out").exists()


@pytest.mark.parametrize("what", ["photo", "strokes", "root"])
def test_a_bad_input_leaves_the_earlier_build(folder, pretend, what):
    build(folder, "a", "b")
    before = digests(folder / "out")
    write_scene(folder, "a", "b", seed=8)
    spoil(folder, what)
    with pytest.raises(InputError):
        build_scene(load_scene(folder / "scene.toml"), folder / "out")
    assert digests(folder / "out") == before


def test_each_photo_is_read_once_to_look_at_it(folder, monkeypatch):
    read = []
    photo = drawn_tree(px_per_metre=40).photo
    monkeypatch.setattr(pipeline, "load_photo", lambda path: read.append(path) or photo)
    check_inputs(load_scene(write_scene(folder, "a", "b", "c")))
    assert len(read) == 1


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device"), RuntimeError("a bug")])
@pytest.mark.parametrize("step", ["_build_job", "_write_stage", "_check", "install"])
def test_whatever_goes_wrong_leaves_the_earlier_build(folder, pretend, monkeypatch, step, error):
    build(folder, "a", "b")
    before = digests(folder / "out")

    def fail(*_, **__):
        raise error

    monkeypatch.setattr(pipeline, step, fail)
    with pytest.raises(type(error)):
        build(folder, "a", "c", seed=9)
    assert digests(folder / "out") == before
    shutil.rmtree(folder / "out")
    with pytest.raises(type(error)):
        build(folder, "a", "c", seed=9)
    assert not (folder / "out").exists()


def test_without_opengl_trees_and_stage_are_written_and_an_old_report_goes(folder, pretend, monkeypatch):
    build(folder, "a")

    def fail(*_):
        raise RenderError("no OpenGL")

    monkeypatch.setattr(pipeline, "_check_job", fail)
    with pytest.raises(RenderError):
        build(folder, "b", seed=9)
    out = folder / "out"
    assert sorted(path.name for path in out.iterdir()) == ["build.json", "seconds.json", "small.usda", "trees"]
    assert [path.name for path in (out / "trees").iterdir()] == ["b"]
    before = digests(out)
    with pytest.raises(RenderError):
        check_output(out)
    assert digests(out) == before


def test_a_failed_tree_leaves_its_earlier_folder_alone(folder, pretend):
    build(folder, "a", "good")
    out = folder / "out"
    a = digests(out / "trees" / "a")
    text = write_scene(folder, "a", "good").read_text()
    (folder / "scene.toml").write_text(text.replace('name = "a"', 'name = "bad"'))
    report = build_scene(load_scene(folder / "scene.toml"), out)
    assert report["trees"][0]["error"] == "too dark for any stage"
    assert [path.name for path in (out / "trees").iterdir()] == ["good"]  # "a" is named no more
    assert a
    build(folder, "bad", "good")
    assert json.loads((out / "build.json").read_text())["trees"][0]["error"] == "too dark for any stage"


def test_a_scene_of_failed_trees_only_has_a_report_and_no_stage(folder, pretend):
    report = build(folder, "bad")
    assert not report["passed"]
    assert not list((folder / "out").glob("*.usda"))
    assert (folder / "out" / "report.html").is_file()


def test_too_little_memory_is_a_tree_that_failed(folder, monkeypatch):
    def build_model(*_):
        raise MemoryError

    monkeypatch.setattr(pipeline, "build_model", build_model)
    report = build(folder, "a")
    assert "memory" in report["trees"][0]["error"]


def test_seconds_are_kept_for_later_checks_and_may_be_gone(folder, pretend):
    report = build(folder, "a")
    assert report["trees"][0]["seconds"] == {"grow": 0.5, "check": 0.25}
    assert check_output(folder / "out")["trees"][0]["seconds"] == {"grow": 0.5, "check": 0.25}
    (folder / "out" / "seconds.json").unlink()
    assert check_output(folder / "out")["trees"][0]["seconds"] == {"check": 0.25}
    (folder / "out" / "seconds.json").write_text("[1")
    with pytest.raises(InputError, match=r"seconds\.json"):
        check_output(folder / "out")


def test_a_folder_that_is_no_build_cannot_be_checked(tmp_path):
    for function in (tree_names, check_output):
        with pytest.raises(InputError, match="forestgen build"):
            function(tmp_path)
    assert not list(tmp_path.iterdir())
