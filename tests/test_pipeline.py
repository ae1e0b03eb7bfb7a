"""A scene from manifest to checked output: what is written, what is refused, and what stays when it goes wrong."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from forestgen import pipeline
from forestgen.errors import InputError, RenderError, StageError
from forestgen.pipeline import build_model, build_scene, check_inputs, check_output, tree_names, write_tree
from forestgen.scene.manifest import Scene, load_scene
from tests.small_scene import defeating_strokes, digests, write_inputs, write_scene
from tests.synthetic import drawn_tree

BUILT = "pretended tree"


@pytest.fixture(scope="session")
def inputs(tmp_path_factory) -> Path:
    """Photo and strokes; tests copy them."""
    return write_inputs(tmp_path_factory.mktemp("inputs"))


@pytest.fixture
def folder(inputs, tmp_path) -> Path:
    """A folder of one's own with photo and strokes."""
    for name in ("photo.png", "strokes.json"):
        shutil.copy(inputs / name, tmp_path)
    return tmp_path


@pytest.fixture
def pretend(monkeypatch):
    """Trees are built and checked in no time: their folders hold one file that says which seed made it."""

    def build(job, on_stage):
        for stage in pipeline.STEPS[:-1]:
            on_stage(stage, 0, 0)
        tree = job.tree
        if "bad" in tree.name:
            raise StageError("too dark for any stage")
        target = job.trees / tree.prim_name
        target.mkdir(parents=True)
        (target / f"{tree.prim_name}.usda").write_text(f"#usda 1.0\n# {BUILT} {tree.seed}\n")
        (target / "cameras.usda").write_text("#usda 1.0\n")
        return {"grow": 0.5}

    def check(job, on_stage):
        from forestgen.check.report import TreeReport

        if isinstance(job, TreeReport):
            return job
        on_stage("check", 0, 0)
        folder = job.pictures
        folder.mkdir()
        (folder / "front.jpg").write_bytes(b"a picture")
        return TreeReport(job.name, job.prim_name, "tan2008", 0, job.gates, seconds={"check": 0.25})

    monkeypatch.setattr(pipeline, "_build_job", build)
    monkeypatch.setattr(pipeline, "_check_job", check)
    monkeypatch.setattr(pipeline, "_write_stage", lambda scene, folder: write_stage(scene, folder))


def write_stage(scene: Scene, folder: Path) -> None:
    if scene.trees:
        (folder / f"{scene.prim_name}.usda").write_text(f"#usda 1.0\n# {[tree.name for tree in scene.trees]}\n")


def build(folder: Path, *names: str, seed: int = 7, **options):
    return build_scene(load_scene(write_scene(folder, *names, seed=seed)), folder / "out", **options)


# --- the real thing -------------------------------------------------------------------------------------------------


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


# --- what goes before and what goes wrong, with pretended trees ------------------------------------------------------


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
