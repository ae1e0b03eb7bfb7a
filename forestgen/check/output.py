"""The check of an output folder, tree by tree: read the written stage back, score it, draw it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from forestgen.check.album import Album, draw_portraits, draw_sheet, view_report
from forestgen.check.film import film_pictures
from forestgen.check.lods import DrawnLevel, score_levels
from forestgen.check.report import TreeReport
from forestgen.check.score import Gates, count, make_gates, score_views
from forestgen.errors import InputError
from forestgen.reference import read_provenance, read_views
from forestgen.render import Studio
from forestgen.tree.skeleton import n_children

REPORT = "report"  # folder of the report's pictures, beside report.html


@dataclass(frozen=True)
class CheckJob:
    """What it takes to check one tree; can be sent to a worker."""

    out: Path
    name: str
    prim_name: str
    gates: Gates
    pictures: Path  # folder to write the pictures to; the report will know it as report/<prim name>


def read_build(out: Path) -> dict[str, Any]:
    """The content of OUT/build.json: {"scene": name, "trees": [{"name", "prim_name", "gates", ...}]}.

    Raises:
        InputError: it is missing or broken.
    """
    path = out / "build.json"
    try:
        build = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: not found; expected a folder that `forestgen build` wrote") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}): build the scene again") from error
    fine = isinstance(build, dict) and isinstance(build.get("trees"), list) and "scene" in build
    if not fine or not all(isinstance(e, dict) and "name" in e and "prim_name" in e for e in build["trees"]):
        raise InputError(f"{path}: lacks 'scene', 'trees' or a tree's 'name' and 'prim_name': build the scene again")
    return {**build, "scene": build["scene"]["name"] if isinstance(build["scene"], dict) else build["scene"]}


def check_job(out: Path, entry: Mapping[str, Any], folder: Path) -> CheckJob:
    """The job of one entry of build.json's trees, its pictures to go below `folder`."""
    prim_name = str(entry["prim_name"])
    return CheckJob(out, str(entry["name"]), prim_name, make_gates(entry.get("gates") or {}), folder / prim_name)


def check_tree(job: CheckJob) -> TreeReport:
    """Score one tree as written, and draw its pictures. How long its stages took is not known here.

    Raises:
        InputError: its folder is missing or broken.
        RenderError: no OpenGL to render with.
    """
    from forestgen.usd.lod_drawables import read_lod_drawables

    folder = job.out / "trees" / job.prim_name
    provenance = read_provenance(folder / "reference")
    views = read_views(folder / "reference")
    levels = [DrawnLevel(*level) for level in read_lod_drawables(folder / f"{job.prim_name}.usda")]
    drawables = levels[0].drawables
    with Studio(drawables) as studio:
        scores = score_views(studio, views, provenance.height, job.gates)
        album = Album(job.pictures, f"{REPORT}/{job.prim_name}")
        rows = tuple(
            view_report(album, f"{index:02d}", view, score, provenance)
            for index, (view, score) in enumerate(zip(views, scores, strict=True))
        )
        portraits = draw_portraits(album, studio, drawables, provenance.name)
    lods = score_levels(levels)
    sheet = draw_sheet(album, levels, provenance.name) if lods else ()
    film = film_pictures(job.out / REPORT / job.prim_name, album.folder, album.href, provenance.name)
    is_tip = n_children(provenance.skeleton.parent) == 0
    return TreeReport(
        name=job.name,
        prim_name=job.prim_name,
        method=provenance.method,
        seed=provenance.seed,
        gates=job.gates,
        views=rows,
        counts={"branches": int(np.count_nonzero(is_tip)), **count(drawables)},
        costs={name: cost.tolist() for name, cost in provenance.costs.items()},
        notes=provenance.notes,
        pictures=portraits,
        lods=tuple(lods),
        lod_sheet=sheet,
        film=film,
    )


def failed_report(entry: Mapping[str, Any], error: str) -> TreeReport:
    """The row of a tree that could not be built."""
    return TreeReport(
        str(entry["name"]),
        str(entry["prim_name"]),
        str(entry.get("method", "")),
        int(entry.get("seed") or 0),
        make_gates(entry.get("gates") or {}),
        error=error,
    )
