"""From a scene manifest to a checked USD forest: what the commands and Python users call."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forestgen.errors import InputError, StageError
from forestgen.scene.forest import place
from forestgen.scene.manifest import Scene, TreeSpec, ViewSpec
from forestgen.tree.build import OnStage, Source, build_tree
from forestgen.tree.methods import STAGES
from forestgen.tree.model import TreeModel
from forestgen.tree.photo import load_photo
from forestgen.tree.strokes import load_strokes
from forestgen.workers import OnProgress, run_parallel

if TYPE_CHECKING:
    from forestgen.check.output import CheckJob
    from forestgen.check.report import TreeReport

STEPS = (*STAGES, "write", "check")  # what progress counts, for each tree
PARTIAL = ".partial"  # ending of everything that is still being written


@dataclass(frozen=True)
class Failure:
    """A tree that a stage could not build, and why."""

    name: str
    prim_name: str
    reason: str


def load_source(view: ViewSpec) -> Source:
    """Read one photo and its strokes.

    Raises:
        InputError: one of them cannot be used.
    """
    photo = load_photo(view.photo)
    return Source(
        photo=photo,
        strokes=load_strokes(view.strokes, photo.size),
        azimuth=view.azimuth,
        elevation=view.elevation,
        scale=view.scale,
        root=view.root,
        focal_px=view.focal_px,
    )


def build_model(tree: TreeSpec, on_stage: OnStage | None = None) -> TreeModel:
    """Build the tree of a manifest's entry, in memory."""
    return build_tree(
        [load_source(view) for view in tree.views],
        tree.method,
        name=tree.name,
        method_name=tree.method_name,
        height=tree.height,
        seed=tree.seed,
        on_stage=on_stage,
    )


def write_tree(model: TreeModel, prim_name: str, trees: Path) -> Path:
    """Write a tree's folder `trees`/`prim_name`: built beside, renamed into place. Returns the folder."""
    from forestgen.check.reference import write_provenance, write_reference
    from forestgen.usd.cameras import write_cameras
    from forestgen.usd.tree_asset import write_tree_asset

    with replacing(trees / prim_name) as folder:
        inside = folder / prim_name  # writers name layers and prims after their folder
        inside.mkdir()
        write_tree_asset(model, inside)
        write_cameras(model, inside)
        write_provenance(model, inside / "reference")
        for index, view in enumerate(model.views):
            write_reference(view, inside / "reference" / f"view_{index:02d}")
    return trees / prim_name


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Give a fresh folder beside `target`; its child of the same name takes target's place at the end.

    Whatever goes wrong before that, target stays as it was and nothing half-written is left.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    work = target.with_name(f".{target.name}{PARTIAL}")
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    try:
        yield work
        fresh = work / target.name
        if target.exists():
            target.rename(work / "replaced")
        fresh.rename(target)
    finally:
        shutil.rmtree(work, ignore_errors=True)


@contextmanager
def replacing_file(target: Path) -> Iterator[Path]:
    """Give a path beside `target` to write to; it takes target's place at the end."""
    work = target.with_name(f".partial_{target.name}")
    try:
        yield work
        work.replace(target)
    finally:
        work.unlink(missing_ok=True)


@dataclass(frozen=True)
class _Job:
    """What a worker needs to build one tree."""

    tree: TreeSpec
    trees: Path  # the folder that holds the trees' folders


def _build_job(job: _Job, on_stage: OnStage) -> Failure | None:
    try:
        model = build_model(job.tree, on_stage)
    except StageError as error:
        return Failure(job.tree.name, job.tree.prim_name, str(error))
    on_stage("write", 0, 0)
    write_tree(model, job.tree.prim_name, job.trees)
    return None


def build_scene(scene: Scene, out: Path, *, jobs: int = 1, on_progress: OnProgress | None = None) -> dict[str, Any]:
    """Build every tree of a scene, place them on a stage, score them; returns the report (DESIGN, section 5).

    A tree that a stage cannot build is left out of the stage and named in the report; the others stand.

    Raises:
        InputError: the scene or `out` cannot be used; nothing was written.
        RenderError: trees and stage are written, but there is no OpenGL to score them with.
    """
    from forestgen.usd.forest_scene import write_forest

    out = Path(out)
    _check_inputs(scene)
    _check_out(out)
    work = [_Job(tree, out / "trees") for tree in scene.trees]
    failures = [one for one in run_parallel(_build_job, work, jobs, _unfinished(on_progress)) if one is not None]
    stage = out / f"{scene.prim_name}.usda"
    forest = place(_without(scene, {failure.name for failure in failures}))
    if len(forest):
        folders = {prim: out / "trees" / prim for prim in forest.prototypes}
        with replacing_file(stage) as path:
            write_forest(
                forest,
                {prim: folder / f"{prim}.usda" for prim, folder in folders.items()},
                {prim: folder / "cameras.usda" for prim, folder in folders.items()},
                path,
                scene.prim_name,
            )
    errors = {failure.name: failure.reason for failure in failures}
    with replacing_file(out / "build.json") as path:
        path.write_text(json.dumps(_build_record(scene, errors), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return check_output(out, jobs=jobs, on_progress=on_progress)


def _build_record(scene: Scene, errors: Mapping[str, str]) -> dict[str, Any]:
    """The content of build.json: the manifest as resolved, and per tree what `check` needs."""
    trees = [
        {
            "name": tree.name,
            "prim_name": tree.prim_name,
            "method": tree.method_name,
            "seed": tree.seed,
            "gates": dict(tree.gates),
            **({"error": errors[tree.name]} if tree.name in errors else {}),
        }
        for tree in scene.trees
    ]
    return scene.resolved() | {"trees": trees}


def _check_inputs(scene: Scene) -> None:
    """Read every photo and stroke set once, so that a bad one is told before anything is written."""
    for tree in scene.trees:
        for view in tree.views:
            load_source(view)


def _check_out(out: Path) -> None:
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; expected a folder to write to: choose another with -o")


def _without(scene: Scene, names: set[str]) -> Scene:
    """The scene without these trees and their copies."""
    return replace(
        scene,
        trees=tuple(tree for tree in scene.trees if tree.name not in names),
        copies=tuple(copy for copy in scene.copies if copy.of not in names),
    )


def _unfinished(on_progress: OnProgress | None) -> OnProgress | None:
    """Pass progress on, but not that a tree is done: its check is still to come."""
    if on_progress is None:
        return None
    return lambda index, stage, done, total: on_progress(index, stage, done, total) if stage else None


def tree_names(out: Path) -> list[str]:
    """Names of the trees of a build that can be checked, in their order."""
    from forestgen.check.output import read_build

    return [entry["name"] for entry in read_build(out)["trees"]]


def _check_job(job: CheckJob | TreeReport, on_stage: OnStage) -> TreeReport:
    from forestgen.check.output import check_tree
    from forestgen.check.report import TreeReport

    if isinstance(job, TreeReport):  # a tree that could not be built
        return job
    on_stage("check", 0, 0)
    return check_tree(job)


def check_output(out: Path, *, jobs: int = 1, on_progress: OnProgress | None = None) -> dict[str, Any]:
    """Render and score the trees of a build as written, and write its report anew; returns the report.

    Raises:
        InputError: `out` is not a build, or a file of it is missing or broken.
        RenderError: there is no OpenGL to render with.
    """
    from forestgen.check.output import check_job, failed_report, read_build, replacing_pictures
    from forestgen.check.report import write_report

    build = read_build(out)
    with replacing_pictures(out) as pictures:
        work = [
            failed_report(entry, entry["error"]) if "error" in entry else check_job(out, entry, pictures)
            for entry in build["trees"]
        ]
        trees = run_parallel(_check_job, work, jobs, on_progress)
    return write_report(out, build["scene"], trees)
