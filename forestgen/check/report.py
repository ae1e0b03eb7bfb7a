"""report.json and report.html: the scores of a scene, for scripts and for people."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from forestgen.check.lods import LodScore
from forestgen.check.plot import Panel, cost_panels
from forestgen.check.score import AT_MOST, MEASURES, Gates

TITLES = {
    "envelope_iou": ("Envelope IoU", "How far the closed outlines of photo and render overlap."),
    "silhouette_iou": ("Silhouette IoU", "The same on raw pixels, gaps and all."),
    "skill": ("Skill", "Silhouette IoU above what leaves thrown at random into the outline would reach."),
    "boundary_f": ("Boundary F", "How much of the two outlines lies within 1 % of the height of each other."),
    "branch_chamfer": ("Branch chamfer", "Mean distance of traced and drawn branches, as a share of the height."),
    "gap_recall": ("Gap recall", "Of the large holes in the crown, the share that is open in the render too."),
    "density_correlation": ("Density r", "Correlation of leaf cover over a 24 x 24 grid."),
    "colour_delta_e": ("Colour ΔE", "Mean CIEDE2000 difference of the blurred colours, unlit."),
}


@dataclass(frozen=True)
class PictureFile:
    """One picture of the report."""

    path: str  # relative to report.html
    caption: str
    alt: str
    size: tuple[int, int]  # (width, height), px


@dataclass(frozen=True)
class ViewReport:
    """One view's scores and pictures."""

    photo: str
    azimuth: float  # degrees
    is_bare: bool
    scores: Mapping[str, float]
    failed: tuple[str, ...]  # gates that it misses
    pictures: tuple[PictureFile, ...] = ()


@dataclass(frozen=True)
class TreeReport:
    """All that the report says of one tree. A tree that could not be built has an error and no views."""

    name: str
    prim_name: str
    method: str
    seed: int
    gates: Gates = field(default_factory=Gates)
    views: tuple[ViewReport, ...] = ()
    seconds: Mapping[str, float] | None = None
    counts: Mapping[str, int] | None = None
    costs: Mapping[str, Sequence[float]] | None = None
    notes: tuple[str, ...] = ()
    pictures: tuple[PictureFile, ...] = ()  # of the tree from other sides
    film: tuple[PictureFile, ...] = ()  # of its growth, where `forestgen grow` made one
    lods: tuple[LodScore, ...] = ()  # levels of detail after the full tree
    lod_sheet: tuple[PictureFile, ...] = ()  # all of them side by side
    error: str | None = None

    @property
    def failed(self) -> tuple[str, ...]:
        """Gates that one of the views misses, in the order of the measures."""
        missed = {name for view in self.views for name in view.failed}
        return tuple(name for name in MEASURES if name in missed)

    @property
    def passed(self) -> bool:
        return self.error is None and bool(self.views) and not self.failed


def report_json(scene: str, trees: Sequence[TreeReport]) -> dict[str, Any]:
    """The content of report.json: DESIGN section 5, and per tree its gates, what failed, and notes."""
    rows = []
    for tree in trees:
        views = [
            {
                "photo": view.photo,
                "azimuth": round(view.azimuth, 4),
                **{name: round(float(view.scores[name]), 4) for name in MEASURES},
                "bare": view.is_bare,
                "failed": list(view.failed),
            }
            for view in tree.views
        ]
        row = {
            "name": tree.name,
            "method": tree.method,
            "seed": tree.seed,
            "passed": tree.passed,
            "views": views,
            "seconds": dict(tree.seconds or {}),
            "counts": dict(tree.counts or {}),
            "prim_name": tree.prim_name,
            "gates": {name: limit for name, limit in asdict(tree.gates).items() if limit is not None},
            "failed": list(tree.failed),
            "lods": [_rounded(asdict(lod)) for lod in tree.lods],
            "notes": list(tree.notes),
        }
        rows.append(row if tree.error is None else {**row, "error": tree.error})
    return {"scene": scene, "passed": bool(trees) and all(tree.passed for tree in trees), "trees": rows}


def _rounded(row: dict[str, Any]) -> dict[str, Any]:
    """A row with its shares and pixels to four digits after the point."""
    return {name: round(value, 4) if isinstance(value, float) else value for name, value in row.items()}


def write_report(out: Path, scene: str, trees: Sequence[TreeReport]) -> dict[str, Any]:
    """Write OUT/report.json and OUT/report.html, each whole or not at all; the pictures lie there already."""
    content = report_json(scene, trees)
    _replace_text(out / "report.html", report_html(content, trees))
    _replace_text(out / "report.json", json.dumps(content, ensure_ascii=False, indent=1) + "\n")
    return content


def report_html(content: Mapping[str, Any], trees: Sequence[TreeReport]) -> str:
    """The page, with every name that users gave escaped."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("forestgen.check", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    environment.filters["score"] = format_score
    cells = [[[cell(tree, view, name) for name in MEASURES] for view in tree.views] for tree in trees]
    panels: list[list[Panel]] = [cost_panels(tree.costs or {}) for tree in trees]
    return environment.get_template("report.html").render(
        scene=content["scene"],
        passed=content["passed"],
        trees=list(zip(trees, cells, panels, strict=True)),
        measures=[(name, *TITLES[name]) for name in MEASURES],
        default=asdict(Gates()),
        at_most=AT_MOST,
    )


def cell(tree: TreeReport, view: ViewReport, name: str) -> dict[str, str]:
    """A table cell: the score, whether it is good, bad or not judged, and its gate in words."""
    limit = getattr(tree.gates, name)
    text = format_score(view.scores[name], name)
    if limit is None or (view.is_bare and name == "skill"):
        return {"text": text, "kind": "free", "gate": "no gate"}
    gate = f"gate {'at most' if name in AT_MOST else 'at least'} {format_score(limit, name)}"
    return {"text": text, "kind": "miss" if name in view.failed else "good", "gate": gate}


def format_score(value: float, name: str) -> str:
    """A score as people read it: the chamfer in percent, colours with one decimal."""
    if name == "branch_chamfer":
        return f"{100 * value:.2f} %"
    return f"{value:.1f}" if name == "colour_delta_e" else f"{value:.3f}"


def _replace_text(target: Path, text: str) -> None:
    work = target.with_name(f".partial_{target.name}")
    try:
        work.write_text(text, encoding="utf-8")
        work.replace(target)
    finally:
        work.unlink(missing_ok=True)
