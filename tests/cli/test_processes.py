"""Builds as a shell starts them: signals, kills, full disks, missing rights, missing OpenGL."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from tests.cli.shell import REPORT, one_line, shell
from tests.small_scene import digests, write_inputs


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
