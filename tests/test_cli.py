"""The commands as a shell sees them: exit codes, one line of complaint, streams, signals, full disks."""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from forestgen import cli, doctor, pipeline
from forestgen.errors import InputError, RenderError, StageError
from tests.small_scene import digests, write_inputs, write_scene


@pytest.fixture(scope="module")
def inputs(tmp_path_factory) -> Path:
    return write_inputs(tmp_path_factory.mktemp("inputs"))


@pytest.fixture
def folder(inputs, tmp_path, monkeypatch) -> Path:
    """The working folder: photo, strokes and a manifest of two trees."""
    for name in ("photo.png", "strokes.json"):
        shutil.copy(inputs / name, tmp_path)
    write_scene(tmp_path, "a", "b")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def run(monkeypatch, capsys):
    """Run a command in this process; gives (exit code, stdout, stderr)."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}

    def run(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["forestgen", *map(str, words)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        out, err = capsys.readouterr()
        return int(end.value.code or 0), out, err

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)


def one_line(text: str) -> str:
    """The text, which must be one line of ours."""
    assert text.startswith("forestgen: ")
    assert text.count("\n") == 1
    return text


REPORT = {
    "scene": "small",
    "passed": True,
    "trees": [
        {
            "name": "a",
            "passed": True,
            "seconds": {"grow": 1.25, "check": 2.5},
            "gates": {"envelope_iou": 0.9},
            "views": [
                {
                    "photo": "p.jpg",
                    "azimuth": 0.0,
                    "envelope_iou": 0.95,
                    "skill": 0.5,
                    "boundary_f": 0.9,
                    "branch_chamfer": 0.0123,
                    "colour_delta_e": 4.0,
                    "failed": [],
                }
            ],
        }
    ],
}


def failing(report: dict) -> dict:
    """The report with the gate of its tree missed."""
    report = json.loads(json.dumps(report))
    tree = report["trees"][0]
    report["passed"] = tree["passed"] = False
    tree["views"][0] |= {"envelope_iou": 0.81234, "failed": ["envelope_iou"]}
    return report


@pytest.fixture
def pretend(monkeypatch, folder):
    """Build and check do nothing but write the given report, or raise the given error."""

    def pretend(outcome):
        def build(*arguments, on_progress=None, **_):
            if isinstance(outcome, BaseException):
                raise outcome
            out = arguments[-1]
            out.mkdir(exist_ok=True)
            (out / "report.json").write_text(json.dumps(outcome))
            (out / "build.json").write_text('{"scene": {"name": "s", "prim_name": "small"}, "trees": []}')
            return outcome

        monkeypatch.setattr(pipeline, "build_scene", build)
        monkeypatch.setattr(pipeline, "check_output", build)

    return pretend


# --- exit codes ---------------------------------------------------------------------------------------------------


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


# --- what is printed ----------------------------------------------------------------------------------------------


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


# --- doctor -------------------------------------------------------------------------------------------------------


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


# --- in a process of its own --------------------------------------------------------------------------------------


def shell(*words: object, limit: int | None = None, **environment: str) -> subprocess.CompletedProcess[bytes]:
    """Run the command; `limit`: bytes that a file may have."""

    def confine() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return subprocess.run(
        [sys.executable, "-m", "forestgen", *map(str, words)],
        capture_output=True,
        env={**os.environ, **environment},
        preexec_fn=confine,
        timeout=300,
    )


def earlier_output(folder: Path) -> dict[str, str]:
    """Something that looks like an earlier build of the scene; returns its digests."""
    out = folder / "out"
    for tree in ("a", "b", "old"):
        (out / "trees" / tree).mkdir(parents=True)
        (out / "trees" / tree / f"{tree}.usda").write_text("#usda 1.0\n# earlier\n")
    trees = [{"name": tree, "prim_name": tree} for tree in ("a", "b", "old")]
    (out / "build.json").write_text(json.dumps({"scene": {"name": "small", "prim_name": "small"}, "trees": trees}))
    (out / "small.usda").write_text("#usda 1.0\n# earlier\n")
    (out / "report.json").write_text(json.dumps(REPORT))
    return digests(out)


def heed_interrupts() -> None:
    """A shell's background jobs, and what they start, ignore SIGINT; a person's terminal does not."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_build_leaves_what_was_there(folder, number, jobs):
    before = earlier_output(folder)
    process = subprocess.Popen(
        [sys.executable, "-m", "forestgen", "build", "scene.toml", "-o", "out", "--jobs", str(jobs)],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=heed_interrupts,
    )
    assert process.stderr is not None
    assert "segment" in process.stderr.readline()  # the first tree has begun
    family = psutil.Process(process.pid).children(recursive=True)
    assert len(family) == (2 if jobs == 2 else 0)
    os.killpg(process.pid, number) if number == signal.SIGINT else process.send_signal(number)  # as a terminal does
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert out == ""
    assert one_line(err[err.index("forestgen:") :])
    assert "Traceback" not in err
    assert digests(folder / "out") == before
    assert not list((folder / "out").rglob(".*"))
    assert not psutil.wait_procs(family, timeout=5)[1]


def test_a_killed_build_leaves_a_hidden_folder_that_the_next_one_clears(folder):
    before = earlier_output(folder)
    words = [sys.executable, "-m", "forestgen", "build", "scene.toml", "-o", "out", "--jobs", "1"]
    process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    process.stderr.readline()
    process.kill()
    process.communicate()
    hidden = [path.name for path in (folder / "out").iterdir() if path.name.startswith(".")]
    assert len(hidden) == 1
    assert {name: digest for name, digest in digests(folder / "out").items() if hidden[0] not in name} == before
    (folder / "strokes.json").write_text("no JSON")  # the next build may even fail ...
    assert shell("build", "scene.toml", "-o", "out").returncode == 2
    write_inputs(folder)
    from forestgen.staging import staging

    with staging(folder / "out"):  # ... whichever begins to write clears it
        pass
    assert digests(folder / "out") == before
    assert not list((folder / "out").glob(".*"))


@pytest.mark.parametrize(("jobs", "limit"), [(1, 2_000), (2, 40_000)])
def test_a_full_disk_is_one_line_and_leaves_what_was_there(folder, jobs, limit):
    before = earlier_output(folder)
    done = shell("build", "scene.toml", "-o", "out", "--quiet", "--jobs", jobs, limit=limit)
    assert done.returncode == 2, done.stderr.decode()
    assert "out" in one_line(done.stderr.decode())
    assert digests(folder / "out") == before
    assert not list((folder / "out").rglob(".*"))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_one_line(folder):
    (folder / "closed").mkdir(mode=0o500)
    done = shell("build", "scene.toml", "-o", "closed/out", "--quiet")
    assert done.returncode == 2
    assert "closed" in one_line(done.stderr.decode())


def test_two_builds_into_one_folder_do_not_meet(folder):
    from forestgen.staging import staging

    with staging(folder / "out"):
        done = shell("build", "scene.toml", "-o", "out", "--quiet")
    assert done.returncode == 2
    assert "another forestgen" in one_line(done.stderr.decode())


def test_without_opengl_all_but_the_report_is_written(folder):
    done = shell("tree", "photo.png", "strokes.json", "-o", "out", PYOPENGL_PLATFORM="nothing")
    assert done.returncode == 3
    complaint = done.stderr.decode().splitlines()[-1]
    assert complaint.startswith("forestgen: ")
    assert "apt-get install" in complaint
    assert "Traceback" not in done.stderr.decode()
    assert (folder / "out" / "photo.usda").is_file()
    assert (folder / "out" / "trees" / "photo" / "photo.usda").is_file()
    assert not (folder / "out" / "report.json").exists()
    assert not list((folder / "out").glob(".*"))
