"""A working folder with a small scene, commands in this process, and builds that do nothing."""

from __future__ import annotations

import json
import shutil
import signal
import sys
from pathlib import Path

import pytest

from forestgen import cli, pipeline
from tests.small_scene import write_inputs, write_scene


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
