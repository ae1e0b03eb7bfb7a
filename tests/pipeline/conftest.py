"""Photo and strokes of a small scene, and trees that are built in no time."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from forestgen import pipeline
from forestgen.errors import StageError
from tests.pipeline.pretended import BUILT, write_stage
from tests.small_scene import write_inputs


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
    monkeypatch.setattr(pipeline, "_write_stage", write_stage)
