"""The table that ends a build: trees, scores, seconds, failed gates, and where things are."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forestgen.errors import InputError

if TYPE_CHECKING:
    from rich.console import Console

COLUMNS = {  # key in report.json -> heading
    "envelope_iou": "envelope",
    "skill": "skill",
    "boundary_f": "boundary",
    "branch_chamfer": "chamfer",
    "colour_delta_e": "dE",
}


def read_report(out: Path) -> dict[str, Any]:
    """The report of a build.

    Raises:
        InputError: there is none.
    """
    path = out / "report.json"
    if not path.is_file():
        raise InputError(f"{out}: no report.json here; expected the folder that 'forestgen build' wrote")
    report: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return report


def print_summary(console: Console, outs: Sequence[Path], reports: Sequence[dict[str, Any]]) -> None:
    """Print one table over all reports, the failed gates, and the paths of stages and reports."""
    from rich.table import Table
    from rich.text import Text

    table = Table("scene", "tree", *COLUMNS.values(), "seconds", "gates")
    failed: list[str] = []
    for report in reports:
        for tree in report["trees"]:
            view = tree["views"][0] if tree["views"] else {}
            figures = [_figure(key, view.get(key)) for key in COLUMNS]
            seconds = f"{sum(tree['seconds'].values()):.1f}"
            verdict = Text("pass", "green") if tree["passed"] else Text("FAIL", "red")
            table.add_row(Text(report["scene"]), Text(tree["name"]), *figures, seconds, verdict)
            failed += [f"{report['scene']}/{tree['name']}: {reason}" for reason in _reasons(tree)]
    console.print(table)
    for line in failed:
        console.print(line, style="red", markup=False)
    for out in outs:
        stage = next(iter(sorted(out.glob("*.usda"))), out)
        console.print(f"stage   {stage}", markup=False, soft_wrap=True)
        console.print(f"report  {out / 'report.html'}", markup=False, soft_wrap=True)


def _reasons(tree: dict[str, Any]) -> list[str]:
    """Why a tree did not pass, one sentence each."""
    if "error" in tree:
        return [str(tree["error"])]
    return [
        f"{view['photo']}: {key} {_figure(key, view[key])} misses its gate {_figure(key, tree['gates'][key])}"
        for view in tree["views"]
        for key in view["failed"]
    ]


def _figure(key: str, value: float | None) -> str:
    if value is None:
        return "-"
    if key == "branch_chamfer":
        return f"{100 * value:.2f} %"
    return f"{value:.1f}" if key == "colour_delta_e" else f"{value:.3f}"
