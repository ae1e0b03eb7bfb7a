"""Variations: other seeds of a tree that was built, grown from what its folder keeps, and a sheet that shows them.

    OUT/trees/NAME/variations/contact_sheet.png
    OUT/trees/NAME/variations/NAME_seed_8/NAME_seed_8.usda ...

They are part of the tree's folder: its next build takes them away with the tree that they vary.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from forestgen.build_record import BUILD
from forestgen.check.pictures import INK, PAPER, Picture, portrait_picture
from forestgen.errors import InputError, RenderError, StageError
from forestgen.finishing import finish
from forestgen.png import write_png
from forestgen.reference import Provenance, read_provenance, read_views, write_provenance
from forestgen.render import Studio, frame_camera
from forestgen.scene.folder_settings import located
from forestgen.scene.paths import Location
from forestgen.staging import install, staging
from forestgen.tree.build import OnStage, grow_views
from forestgen.tree.methods import STAGES, Method, configure
from forestgen.tree.model import TreeModel
from forestgen.tree.skeleton import n_children
from forestgen.tree.view import View
from forestgen.workers import OnProgress, run_parallel

VARIATIONS, SHEET = "variations", "contact_sheet.png"
STEPS = (*STAGES, "levels", "write")  # what progress counts, for each seed
PORTRAIT = (360, 420)  # px
SIDES = (0.0, 60.0)  # degrees: as in the first photo, where all seeds look alike, and from where no photo shows them
CAPTION = 34  # px below a portrait
LONGEST_NAME = 46  # of 64 characters, so that the seed has room


@dataclass(frozen=True)
class _Job:
    """What a worker needs to grow one variation, or to draw one tree."""

    tree: Path  # the folder of the tree as built
    method: Method
    seed: int
    folder: Path  # to write to


def vary_tree(
    tree: Path, count: int, *, root: Path | None = None, jobs: int = 1, on_progress: OnProgress | None = None
) -> dict[str, Any]:
    """Grow `count` variations of the tree in a folder OUT/trees/NAME; returns what was made.

    The photos' mattes and traced branches are taken as found; what is drawn by chance is drawn anew,
    from the seeds that follow the tree's own. Paths of settings start from `root`, else from here.

    Raises:
        InputError: the folder is not that of a tree that a build wrote.
        OSError: it could not be written to; earlier variations stay.
        RenderError: the variations are written, but there is no OpenGL to draw the sheet with.
    """
    tree = Path(tree)
    provenance = read_tree(tree)
    method = recorded_method(tree, provenance, root or Path())
    seeds = [provenance.seed + 1 + k for k in range(count)]
    names = [f"{tree.resolve().name[:LONGEST_NAME]}_seed_{seed}" for seed in seeds]
    with staging(tree) as work:
        target = work / VARIATIONS
        todo = [_Job(tree, method, seed, target / name) for seed, name in zip(seeds, names, strict=True)]
        made = run_parallel(_grow_job, todo, jobs, on_progress)
        target.mkdir(exist_ok=True)
        fine = [job for job, result in zip(todo, made, strict=True) if not isinstance(result, StageError)]
        try:
            drawn = run_parallel(_draw_job, [_Job(tree, method, provenance.seed, tree.resolve()), *fine], jobs)
        except RenderError:
            install(work, tree, [VARIATIONS])
            raise
        captions = [f"seed {provenance.seed}, as built", *(f"seed {job.seed}" for job in fine)]
        shown = [(p, c) for p, c in zip(drawn, captions, strict=True) if not isinstance(p, StageError)]
        write_png(target / SHEET, contact_sheet([p for p, _ in shown], [c for _, c in shown]))
        install(work, tree, [VARIATIONS])
    return {
        "tree": provenance.name,
        "method": provenance.method,
        "seed": provenance.seed,
        "sheet": f"{VARIATIONS}/{SHEET}",
        "variations": [_entry(*of) for of in zip(seeds, names, made, strict=True)],
        "passed": len(fine) == count,
    }


def read_tree(tree: Path) -> Provenance:
    """How the tree in a folder came about.

    Raises:
        InputError: no build wrote a tree there.
    """
    if not (tree / "reference" / "provenance.json").is_file():
        raise InputError(f"{tree}: expected a tree's folder OUT/trees/NAME that 'forestgen build' wrote")
    return read_provenance(tree / "reference")


def recorded_method(tree: Path, provenance: Provenance, root: Path) -> Method:
    """The method that built a tree, with the strategies and settings that its build's record holds.

    A tree's folder that was taken out of its build has no record: the method's own settings hold then.

    Raises:
        InputError: the record, or what it says, cannot be used.
    """
    path = tree.resolve().parents[1] / BUILD
    if not path.is_file():
        return configure(provenance.method, {}, {})
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        names = [entry["name"] for entry in record["trees"] if entry["prim_name"] == tree.resolve().name]
        entries = [entry for entry in record["tree"] if entry["name"] in names]
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise InputError(f"{path}: cannot be read ({error}): build the scene again") from error
    if not entries:
        return configure(provenance.method, {}, {})
    where = f"{path}: tree '{provenance.name}'"
    try:
        method = configure(entries[0]["method"], entries[0]["stages"], entries[0]["settings"])
    except InputError as error:
        raise InputError(f"{where}: {error}: it was written by another forestgen; build the scene again") from error
    folder = root.resolve()
    return located(method, Location(folder, folder), f"{where} (paths start from --root, the scene's root folder)")


def regrown(
    views: Sequence[View], method: Method, provenance: Provenance, seed: int, on_stage: OnStage | None = None
) -> TreeModel:
    """The tree of these views from another seed; mattes and traced branches stay as they were found.

    Raises:
        StageError: the seed leads to nothing.
    """
    model = grow_views(
        views,
        method,
        name=provenance.name,
        method_name=provenance.method,
        height=provenance.height,
        seed=seed,
        on_stage=on_stage,
    )
    return replace(model, evergreen=provenance.evergreen)


def contact_sheet(portraits: Sequence[Picture], captions: Sequence[str]) -> Picture:
    """Portraits (H, W, 3) of one size in rows, each with its caption below."""
    height, width = portraits[0].shape[:2]
    columns = math.ceil(math.sqrt(len(portraits)))
    rows = math.ceil(len(portraits) / columns)
    sheet = np.full((rows * (height + CAPTION), columns * width, 3), PAPER, np.uint8)
    for k, (portrait, caption) in enumerate(zip(portraits, captions, strict=True)):
        top, left = k // columns * (height + CAPTION), k % columns * width
        sheet[top : top + height, left : left + width] = portrait
        foot = (left + 12, top + height + CAPTION - 11)
        cv2.putText(sheet, caption, foot, cv2.FONT_HERSHEY_SIMPLEX, 0.55, INK, 1, cv2.LINE_AA)
    return sheet


def _grow_job(job: _Job, on_stage: OnStage) -> dict[str, int]:
    """Grow one variation and write its asset; returns counts."""
    from forestgen.usd.tree_asset import write_tree_asset

    provenance = read_tree(job.tree)
    try:
        model = regrown(read_views(job.tree / "reference"), job.method, provenance, job.seed, on_stage)
    except MemoryError as error:
        raise StageError("there is too little memory for it: use fewer --jobs") from error
    on_stage("levels", 0, 0)
    extras = finish(model)
    on_stage("write", 0, 0)
    job.folder.mkdir(parents=True)
    write_tree_asset(model, job.folder, extras)
    write_provenance(model, job.folder / "reference")
    branches = int(np.count_nonzero(n_children(model.skeleton.parent) == 0))
    return {"branches": branches, "leaves": len(model.leaves)}


def _draw_job(job: _Job, on_stage: OnStage) -> Picture:
    """Lit portraits of one written tree, side by side."""
    from forestgen.usd.read import read_drawables

    drawables = read_drawables(job.folder / f"{job.folder.name}.usda")
    portraits = []
    with Studio(drawables) as studio:
        for side in SIDES:
            camera = frame_camera(drawables, azimuth=math.radians(side), size=PORTRAIT, margin=0.07)
            portraits.append(portrait_picture(studio.lit(camera), foot=camera.root_px))
    return np.hstack(portraits)


def _entry(seed: int, name: str, made: dict[str, int] | StageError) -> dict[str, Any]:
    """What is told of one variation."""
    if isinstance(made, StageError):
        return {"seed": seed, "error": str(made)}
    return {"seed": seed, "asset": f"{VARIATIONS}/{name}/{name}.usda", **made}
