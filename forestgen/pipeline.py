"""From a scene manifest to a checked USD forest: what the commands and Python users call."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, get_args

from forestgen.build_record import (
    BUILD,
    REPORT,
    SECONDS,
    arrays_name,
    read_seconds,
    stage_name,
    stale_entries,
    write_record,
    write_seconds,
)
from forestgen.errors import InputError, RenderError, StageError
from forestgen.finishing import Finish, finish
from forestgen.scene.forest import place
from forestgen.scene.manifest import Scene, TreeSpec, ViewSpec
from forestgen.staging import install, staging
from forestgen.tree.build import OnStage, Source, build_tree
from forestgen.tree.methods import STAGES
from forestgen.tree.model import TreeModel
from forestgen.tree.photo import load_photo
from forestgen.tree.strokes import load_strokes
from forestgen.workers import OnProgress, run_parallel

if TYPE_CHECKING:
    from forestgen.check.output import CheckJob
    from forestgen.check.report import TreeReport
    from forestgen.usd.extras import Extras
    from forestgen.usd.forest_scene import Instancing

STEPS = (*STAGES, "levels", "write", "check")  # what progress counts, for each tree


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
    """Build the tree of a manifest's entry, in memory.

    Raises:
        InputError: a photo or stroke set cannot be used.
        StageError: a photo defeats a stage.
    """
    model = build_tree(
        [load_source(view) for view in tree.views],
        tree.method,
        name=tree.name,
        method_name=tree.method_name,
        height=tree.height,
        seed=tree.seed,
        on_stage=on_stage,
    )
    return replace(model, evergreen=tree.evergreen)


def write_tree(model: TreeModel, prim_name: str, trees: Path, extras: Extras | None = None) -> Path:
    """Write a tree's folder `trees`/`prim_name`: built beside, moved into place. Returns the folder.

    `extras` are what `finish(model)` makes unless given.

    Raises:
        OSError: it could not be written; what was there before stays.
    """
    with staging(trees) as work:
        _write_tree(model, work / prim_name, extras or finish(model))
        install(work, trees, [prim_name])
    return trees / prim_name


def _write_tree(model: TreeModel, folder: Path, extras: Extras) -> None:
    """Write layers, textures and reference into a new folder; layers and prims are named after it."""
    from forestgen.reference import write_provenance, write_reference
    from forestgen.usd.cameras import write_cameras
    from forestgen.usd.tree_asset import write_tree_asset

    folder.mkdir(parents=True)
    views = [folder / "reference" / f"view_{index:02d}" for index in range(len(model.views))]
    with ThreadPoolExecutor(1) as aside:
        kept = aside.map(write_reference, model.views, views)
        write_tree_asset(model, folder, extras)
        write_cameras(model, folder)
    list(kept)  # raises what went wrong with a view
    write_provenance(model, folder / "reference")


@dataclass(frozen=True)
class _Job:
    """What a worker needs to build one tree."""

    tree: TreeSpec
    trees: Path  # the folder that holds the trees' folders
    wanted: Finish


def _build_job(job: _Job, on_stage: OnStage) -> dict[str, float]:
    """Build and write one tree; returns the seconds that each stage took."""
    try:
        model = build_model(job.tree, on_stage)
    except MemoryError as error:
        raise StageError("there is too little memory for it: use a smaller photo, or fewer --jobs") from error
    on_stage("levels", 0, 0)
    start = perf_counter()
    extras = finish(model, job.wanted)
    on_stage("write", 0, 0)
    finished = perf_counter()
    _write_tree(model, job.trees / job.tree.prim_name, extras)
    return {**model.seconds, "levels": finished - start, "write": perf_counter() - finished}


def build_scene(
    scene: Scene,
    out: Path,
    *,
    instancing: str = "auto",
    wanted: Finish | None = None,
    jobs: int = 1,
    on_progress: OnProgress | None = None,
) -> dict[str, Any]:
    """Build every tree of a scene, place them on a stage, score them; returns the report (DESIGN, section 5).

    All is made in a hidden folder inside `out` and takes its place at the end, so an interrupted build
    leaves an earlier one as it was. A tree that a stage cannot build is left out of the stage and named
    in the report. `instancing` says what the trees become on the stage: `native` prims, `points` of an
    instancer, or `auto`; `wanted`, what assets hold only where it is asked for. Trees of an earlier
    build in `out` that the scene no longer names are removed.

    Raises:
        InputError: the scene, `out` or `instancing` cannot be used; nothing was written.
        OSError: `out` could not be written to; an earlier build is as it was.
        RenderError: trees and stage are written, but there is no OpenGL to score them with.
    """
    out = Path(out)
    check_inputs(scene)
    kind = _checked_instancing(instancing)
    stage, arrays = stage_name(scene.prim_name), arrays_name(scene.prim_name)
    fresh = [BUILD, SECONDS, *(f"trees/{tree.prim_name}" for tree in scene.trees), stage, arrays]
    stale = stale_entries(out, [*fresh, *REPORT])
    with staging(out) as work:
        seconds, errors = _build_trees(scene, work / "trees", wanted or Finish(), jobs, _unfinished(on_progress))
        _write_stage(_without(scene, set(errors)), work, kind)
        write_record(work, scene, errors)
        write_seconds(work, seconds)
        fresh = [name for name in fresh if (work / name).exists()]
        if stage in fresh and arrays not in fresh:
            stale.append(arrays)
        try:
            report = _check(work, work, jobs, on_progress)
        except RenderError:
            install(work, out, fresh, [*stale, *REPORT])
            raise
        install(work, out, [*fresh, *REPORT], stale)
    return report


def _build_trees(
    scene: Scene, trees: Path, wanted: Finish, jobs: int, on_progress: OnProgress | None
) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """Build all trees below a folder; returns seconds by prim name, and by name why a tree could not be built."""
    outcomes = run_parallel(_build_job, [_Job(tree, trees, wanted) for tree in scene.trees], jobs, on_progress)
    seconds, errors = {}, {}
    for tree, outcome in zip(scene.trees, outcomes, strict=True):
        if isinstance(outcome, StageError):
            errors[tree.name] = str(outcome)
        else:
            seconds[tree.prim_name] = outcome
    return seconds, errors


def check_inputs(scene: Scene) -> None:
    """Read every photo and stroke set once, so that a bad one is told before anything is written.

    Raises:
        InputError: one of them cannot be used.
    """
    sizes: dict[Path, tuple[int, int]] = {}
    for tree in scene.trees:
        for view in tree.views:
            if view.photo not in sizes:
                sizes[view.photo] = load_photo(view.photo).size
            width, height = sizes[view.photo]
            load_strokes(view.strokes, (width, height))
            if view.root is not None and not (0 <= view.root[0] <= width and 0 <= view.root[1] <= height):
                raise InputError(
                    f"{scene.path}: tree '{tree.name}': root: expected a point inside the photo {view.photo}"
                    f" ({width} x {height} px), came {list(view.root)}: measure it in the upright photo"
                )


def _checked_instancing(name: str) -> Instancing:
    from forestgen.usd.forest_scene import Instancing

    kind: Instancing
    for kind in get_args(Instancing):
        if name == kind:
            return kind
    raise InputError(f"instancing: expected one of {', '.join(get_args(Instancing))}, came {name!r}")


def _write_stage(scene: Scene, folder: Path, instancing: Instancing) -> None:
    """Write the scene's stage beside its trees; none where no tree could be built."""
    from forestgen.usd.forest_scene import write_forest

    forest = place(scene)
    if len(forest):
        trees = {prim: folder / "trees" / prim for prim in forest.prototypes}
        write_forest(
            forest,
            {prim: tree / f"{prim}.usda" for prim, tree in trees.items()},
            {prim: tree / "cameras.usda" for prim, tree in trees.items()},
            folder / stage_name(scene.prim_name),
            scene.prim_name,
            instancing=instancing,
        )


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
    """Names of the trees of a build that can be checked, in their order.

    Raises:
        InputError: `out` is not a build.
    """
    from forestgen.check.output import read_build

    return [entry["name"] for entry in read_build(out)["trees"]]


def check_output(out: Path, *, jobs: int = 1, on_progress: OnProgress | None = None) -> dict[str, Any]:
    """Render and score the trees of a build as written, and write its report anew; returns the report.

    Raises:
        InputError: `out` is not a build, or a file of it is missing or broken.
        RenderError: there is no OpenGL to render with. The earlier report stays, as with every error.
    """
    from forestgen.check.output import read_build

    out = Path(out)
    read_build(out)
    with staging(out) as work:
        report = _check(out, work, jobs, on_progress)
        install(work, out, REPORT)
    return report


def _check(build: Path, target: Path, jobs: int, on_progress: OnProgress | None) -> dict[str, Any]:
    """Score the trees of the folder `build`; the report and its pictures go to the folder `target`."""
    from forestgen.check.output import check_job, failed_report, read_build
    from forestgen.check.report import write_report

    content = read_build(build)
    entries = content["trees"]
    seconds = read_seconds(build)
    pictures = target / REPORT[0]
    pictures.mkdir()
    work = [
        failed_report(entry, entry["error"]) if "error" in entry else check_job(build, entry, pictures)
        for entry in entries
    ]
    outcomes = run_parallel(_check_job, work, jobs, on_progress)
    trees = []
    for entry, tree in zip(entries, outcomes, strict=True):
        scored = failed_report(entry, str(tree)) if isinstance(tree, StageError) else tree
        trees.append(replace(scored, seconds={**seconds.get(entry["prim_name"], {}), **(scored.seconds or {})}))
    return write_report(target, content["scene"], trees)


def _check_job(job: CheckJob | TreeReport, on_stage: OnStage) -> TreeReport:
    from forestgen.check.output import check_tree
    from forestgen.check.report import TreeReport

    if isinstance(job, TreeReport):  # a tree that could not be built
        return job
    on_stage("check", 0, 0)
    start = perf_counter()
    report = check_tree(job)
    return replace(report, seconds={"check": round(perf_counter() - start, 3)})
