"""The table that ends a build: trees, scores and seconds, failed gates, and where things are."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forestgen.errors import InputError
from forestgen.progress import WIDTH, one_line

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

COLUMNS = {  # key in report.json -> heading
    "envelope_iou": "envelope",
    "skill": "skill",
    "boundary_f": "boundary",
    "branch_chamfer": "chamfer",
    "colour_delta_e": "dE",
}
AT_MOST = ("branch_chamfer", "colour_delta_e")  # gates that a figure must not exceed


def read_report(out: Path) -> dict[str, Any]:
    """The report of a build.

    Raises:
        InputError: there is none, or it is broken.
    """
    path = out / "report.json"
    if not path.is_file():
        raise InputError(f"{out}: no report.json here; expected the folder that 'forestgen build' wrote")
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
        _ = report["scene"], report["passed"], [(tree["name"], tree["views"]) for tree in report["trees"]]
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise InputError(f"{path}: cannot be read ({error}): run 'forestgen check {out}' to write it anew") from error
    return dict(report)


def print_summary(console: Console, outs: Sequence[Path], reports: Sequence[dict[str, Any]]) -> None:
    """Print one table over all reports, the failed gates, and the paths of stages and reports."""
    table = _table()
    for report in reports:
        table.add_section()
        table.add_row(_name(report["scene"], "bold"))
        for tree in report["trees"]:
            for row in _rows(tree):
                table.add_row(*row)
    console.print(table)
    for report in reports:
        for tree in report["trees"]:
            for reason in reasons(tree):
                line = f"{one_line(report['scene'])} / {one_line(tree['name'])}: {one_line(reason)}"
                console.print(line, style="red", markup=False, soft_wrap=True)
    for out, report in zip(outs, reports, strict=True):
        for what, path in (("stage", _stage(out, report)), ("report", out / "report.html")):
            console.print(f"{what:7} {path}", markup=False, soft_wrap=True)


def _table() -> Table:
    from rich import box
    from rich.table import Column, Table

    return Table(
        Column("tree", no_wrap=True, overflow="ellipsis", max_width=WIDTH, ratio=1),
        *(Column(heading, justify="right", no_wrap=True) for heading in COLUMNS.values()),
        Column("seconds", justify="right", no_wrap=True),
        Column("gates", no_wrap=True),
        box=box.SIMPLE_HEAD,
        padding=(0, 1),
        pad_edge=False,
    )


def _rows(tree: dict[str, Any]) -> Iterator[list[Text]]:
    """A tree's rows: one a view, the first with its name, seconds and verdict."""
    from rich.text import Text

    spent = sum((tree.get("seconds") or {}).values())
    verdict = Text("pass", "green") if tree["passed"] else Text("FAIL" if tree["views"] else "not built", "bold red")
    ends = [Text(f"{spent:.1f}" if spent else "-"), verdict]
    if not tree["views"]:
        yield [_name("  " + one_line(tree["name"])), *(Text("-", "dim") for _ in COLUMNS), *ends]
    for index, view in enumerate(tree["views"]):
        name = one_line(tree["name"]) if index == 0 else f"  at {view['azimuth']:g} degrees"
        figures = [Text(figure(key, view[key]), "red" if key in view["failed"] else "") for key in COLUMNS]
        yield [_name("  " + name), *figures, *(ends if index == 0 else ())]


def _name(name: str, style: str = "") -> Text:
    from rich.text import Text

    return Text(name, style)


def _stage(out: Path, report: dict[str, Any]) -> Path | str:
    """Where the scene's stage is."""
    if not any(tree["views"] for tree in report["trees"]):
        return "none: no tree could be built"
    try:
        prim_name = json.loads((out / "build.json").read_text(encoding="utf-8"))["scene"]["prim_name"]
    except (OSError, ValueError, LookupError, TypeError):
        return out
    return out / f"{prim_name}.usda"


def reasons(tree: dict[str, Any]) -> list[str]:
    """Why a tree did not pass, one sentence each."""
    if "error" in tree:
        return [str(tree["error"])]
    return [
        f"{view['photo']}: {key} is {figure(key, view[key])},"
        f" its gate wants {'at most' if key in AT_MOST else 'at least'} {figure(key, tree['gates'][key])}"
        for view in tree["views"]
        for key in view["failed"]
    ]


def figure(key: str, value: float) -> str:
    """A score as people read it: the chamfer in percent, colours with one decimal."""
    if key == "branch_chamfer":
        return f"{100 * value:.2f} %"
    return f"{value:.1f}" if key == "colour_delta_e" else f"{value:.3f}"
