"""The commands: exit codes, one line of complaint, what is printed, and the doctor."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from forestgen import doctor, exporting
from forestgen.errors import InputError, RenderError, StageError
from tests.cli.shell import REPORT, failing, one_line, shell
from tests.small_scene import digests


@pytest.mark.parametrize("command", ["build", "tree", "check"])
@pytest.mark.parametrize(
    ("outcome", "code", "says"),
    [
        (REPORT, 0, ""),
        (failing(REPORT), 1, ""),
        (StageError("too dark"), 1, "too dark"),
        (InputError("a.json: two\nlines"), 2, "a.json: two lines"),
        (OSError(28, "No space left on device", "x.usdc"), 2, "x.usdc: No space left on device: make room"),
        (PermissionError(13, "Permission denied", "/out"), 2, "/out: Permission denied: choose a folder"),
        (OSError("x could not be written: no reason"), 2, "x could not be written: no reason"),
        (RenderError("no OpenGL: apt-get"), 3, "no OpenGL: apt-get"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_exit_codes(run, pretend, folder, command, outcome, code, says):
    pretend(outcome)
    words = {"build": ["scene.toml", "-o", "out"], "tree": ["photo.png", "strokes.json", "-o", "out"], "check": ["out"]}
    if command == "check":
        (folder / "out").mkdir()
        (folder / "out" / "build.json").write_text('{"scene": "s", "trees": []}')
    came, _, err = run(command, *words[command], "--quiet")
    assert came == code
    if says:
        assert says in one_line(err)
    else:
        assert err == ""


def test_every_wish_reaches_the_export(run, folder, monkeypatch):
    asked = []

    def export(*arguments):
        asked.append(arguments)
        return []

    monkeypatch.setattr(exporting, "export", export)
    words = "out -o made --profile web --level 2 --max-triangles 500 --max-instances 60 --season autumn --rig"
    run("export", *words.split(), "--variant", "light=delit", "--no-instancing")
    run("export", "out", "-o", "made")
    wishes = exporting.Wishes(2, 500, 60, "autumn", {"light": "delit"}, instancing=False, rig=True)
    assert asked == [
        (Path("out"), Path("made"), "web", wishes),
        (Path("out"), Path("made"), "usd", exporting.Wishes()),
    ]


def test_a_season_that_there_is_not_is_told_in_one_line(run, folder):
    came, _, err = run("export", folder, "-o", "made", "--profile", "glb", "--season", "spring")
    assert came == 2
    assert "--season: expected one of photo, summer, autumn, winter, came 'spring'" in one_line(err)
    assert not (folder / "made").exists()


def test_a_bug_is_not_hidden(run, pretend):
    pretend(ZeroDivisionError("a bug"))
    with pytest.raises(ZeroDivisionError):
        run("build", "scene.toml", "-o", "out")


@pytest.mark.parametrize(
    "words",
    [
        ["build"],
        ["build", "scene.toml"],
        ["build", "scene.toml", "-o", "out", "--jobs", "-1"],
        ["build", "scene.toml", "-o", "out", "--jobs", "many"],
        ["fell"],
        ["tree", "photo.png", "-o", "out"],
        ["check", "out", "--loud"],
    ],
)
def test_wrong_usage_exits_with_2(run, folder, words):
    code, out, err = run(*words)
    assert code == 2
    assert out == ""
    assert "Usage" in err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["build", "gone.toml", "-o", "out"], "gone.toml"),
        (["build", "photo.png", "-o", "out"], "photo.png"),
        (["build", "scene.toml", "-o", "photo.png"], "photo.png: is a file"),
        (["build", "scene.toml", "-o", "photo.png/out"], "photo.png"),
        (["build", "scene.toml", "-o", "out", "--root", "gone"], "gone"),
        (["tree", "gone.jpg", "strokes.json", "-o", "out"], "gone.jpg"),
        (["tree", "photo.png", "gone.json", "-o", "out"], "gone.json"),
        (["tree", "strokes.json", "strokes.json", "-o", "out"], "strokes.json"),
        (["tree", "photo.png", "photo.png", "-o", "out"], "photo.png"),
        (["tree", "photo.png", "strokes.json", "-o", "out", "--height", "-3"], "height"),
        (["tree", "photo.png", "strokes.json", "-o", "out", "--height", "nan"], "height"),
        (["tree", "photo.png", "strokes.json", "-o", "out", "--method", "tan2009"], "tan2008"),
        (["check", "."], "build.json"),
        (["check", "gone"], "gone"),
        (["summary", "."], "report.json"),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_2(run, folder, words, says):
    before = digests(folder)
    code, out, err = run(*words)
    assert (code, out) == (2, "")
    assert says in one_line(err)
    assert digests(folder) == before
    assert not (folder / "out").exists()


def test_json_is_all_that_stdout_gets(run, pretend):
    pretend(failing(REPORT))
    code, out, err = run("build", "scene.toml", "-o", "out", "--json")
    assert code == 1
    assert json.loads(out) == failing(REPORT)
    assert err == ""


def test_quiet_says_nothing(run, pretend):
    pretend(failing(REPORT))
    assert run("build", "scene.toml", "-o", "out", "--quiet") == (1, "", "")


def test_the_table_names_trees_scores_failed_gates_and_paths(run, pretend, folder):
    pretend(failing(REPORT))
    _, out, _ = run("build", "scene.toml", "-o", "out")
    assert "0.812" in out
    assert "1.23 %" in out
    assert "3.8" in out  # seconds, check included
    assert "small / a: p.jpg: envelope_iou is 0.812, its gate wants at least 0.900" in out
    assert "out/small.usda" in out
    assert "out/report.html" in out


def test_odd_names_do_not_break_the_table(run, pretend, folder):
    report = failing(REPORT)
    row = report["trees"][0]
    long, emoji = "oak " * 75, "\N{DECIDUOUS TREE}" * 80
    bare = {"views": [], "error": "[red]no\ntrunk[/red]", "seconds": {}}
    report["trees"] = [row | {"name": long}, row | {"name": emoji}, row | {"name": "[bold]\n\x1b[31m"} | bare]
    pretend(report)
    code, out, _ = run("build", "scene.toml", "-o", "out")
    assert code == 1
    table = [line for line in out.split("stage ")[0].splitlines() if "/" not in line]
    assert max(len(line) for line in table) <= 110
    assert "\x1b" not in out
    assert "[red]no trunk[/red]" in out


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_any_terminal_can_print_any_name(folder, encoding):
    out = folder / "out"
    out.mkdir()
    report = json.loads(json.dumps(REPORT).replace('"name": "a"', '"name": "\\ud83c\\udf33 \\u00d6"'))
    (out / "report.json").write_text(json.dumps(report))
    for options in (["summary", "out"], ["summary", "gone\N{DECIDUOUS TREE}"]):
        done = shell(*options, PYTHONIOENCODING=encoding, LC_ALL="C")
        assert done.returncode == (2 if "gone" in options[1] else 0)
        assert b"Traceback" not in done.stderr


def test_several_summaries_are_one_table(run, folder):
    for name in ("x", "y"):
        (folder / name).mkdir()
        (folder / name / "report.json").write_text(json.dumps({**REPORT, "scene": name}))
    code, out, _ = run("summary", "x", "y")
    assert code == 0
    assert out.count("envelope") == 1


@pytest.mark.parametrize("content", ["", "[]", '{"trees": 4}', '{"scene": "s", "passed": true, "trees": [{}]}'])
def test_a_broken_report_is_named(run, folder, content):
    (folder / "report.json").write_text(content)
    code, _, err = run("summary", ".")
    assert code == 2
    assert "report.json" in one_line(err)


def test_help_needs_no_heavy_library():
    code = (
        "import sys; sys.argv = ['forestgen', '--help']\n"
        "from forestgen.cli import _run; assert _run() == 0\n"
        "heavy = {'numpy', 'scipy', 'cv2', 'numba', 'pxr', 'pyrender', 'PIL', 'jinja2', 'pydantic', 'skimage'}\n"
        "assert not heavy & sys.modules.keys(), heavy & sys.modules.keys()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for command in ("build", "tree", "check", "summary", "doctor"):
        assert command in done.stdout


def test_a_reader_that_goes_away_is_no_error(folder):
    (folder / "report.json").write_text(json.dumps(REPORT))
    done = subprocess.run(
        f"{sys.executable} -m forestgen summary . . . . 2>err | true", shell=True, capture_output=True, cwd=folder
    )
    assert done.returncode == 0
    assert (folder / "err").read_text() == ""


@pytest.mark.gl
def test_doctor_finds_nothing_wrong_here(run):
    code, out, _ = run("doctor")
    assert code == 0
    assert "BAD" not in out
    assert "OpenGL" in out
    assert "numpy" in out


def test_doctor_names_what_is_missing(run, monkeypatch):
    monkeypatch.setattr(doctor, "required_packages", lambda: ["numpy", "no-such-package"])
    code, out, _ = run("doctor")
    assert code == 3
    assert "BAD  no-such-package is not installed" in out
    assert "make setup" in out


def test_doctor_looks_at_every_package_that_the_project_names():
    names = doctor.required_packages()
    assert {"numpy", "usd-core", "pyrender", "PyMaxflow"} <= set(names)
    assert not {"pytest", "ruff", "hypothesis"} & set(names)


@pytest.mark.parametrize(("normals", "code"), [("(0, 0, 1)", 0), ("(0, nan, 1)", 1)])
def test_validate_prints_a_line_a_finding(run, folder, normals, code):
    (folder / "a.usda").write_text(
        '#usda 1.0\n(\n    defaultPrim = "a"\n    metersPerUnit = 1\n    upAxis = "Y"\n)\n'
        'def Mesh "a"\n{\n    float3[] extent = [(0, 0, 0), (1, 1, 0)]\n    int[] faceVertexCounts = [3]\n'
        "    int[] faceVertexIndices = [0, 1, 2]\n    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]\n"
        f'    normal3f[] normals = [{", ".join([normals] * 3)}] (interpolation = "vertex")\n'
        '    uniform token subdivisionScheme = "none"\n}\n'
    )
    came, out, _ = run("validate", "a.usda")
    assert came == code
    lines = out.splitlines()
    assert lines[-1] == (
        "a.usda: no findings" if not code else f"a.usda: {len(lines) - 1} finding{'s' * (len(lines) > 2)}"
    )
    assert all(line.startswith("error: /a") and "; " in line for line in lines[:-1])
    came, out, _ = run("validate", "a.usda", "--json")
    assert came == code
    assert [found["place"].split(".")[0] for found in json.loads(out)] == ["/a"] * (len(lines) - 1)


def test_validate_refuses_what_is_no_usd(run, folder):
    code, _, err = run("validate", "photo.png")
    assert code == 2
    assert "photo.png" in one_line(err)
