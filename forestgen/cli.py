"""The commands. Thin: they parse, show progress and print; heavy imports happen inside them."""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from forestgen.errors import ForestgenError, RenderError

if TYPE_CHECKING:
    from rich.console import Console

    from forestgen.workers import OnProgress

app = typer.Typer(
    help="Photographs and a few strokes in, a USD forest out, with a number for how well it matches.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Out = Annotated[Path, typer.Option("--out", "-o", help="Folder to write to; earlier output is replaced tree by tree.")]
Jobs = Annotated[int, typer.Option("--jobs", "-j", min=0, help="Worker processes; 0 = one a core.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print the report as JSON and nothing else.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Log every stage with its seconds.")]
Root = Annotated[Path | None, typer.Option(help="Folder that the manifest's paths may climb up to.")]

GATE_FAILED, BAD_INPUT, NO_RENDERER, INTERRUPTED = 1, 2, 3, 130


@app.command()
def build(
    scene: Annotated[Path, typer.Argument(help="The scene manifest (TOML).")],
    out: Out,
    root: Root = None,
    jobs: Jobs = 0,
    quiet: Quiet = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Build every tree of a scene, its USD stage, and the report that scores it."""
    _start_logging(verbose)
    from forestgen.pipeline import build_scene
    from forestgen.scene.manifest import load_scene

    spec = load_scene(scene, root)
    with _progress([tree.name for tree in spec.trees], quiet or as_json) as on_progress:
        build_scene(spec, out, jobs=_n_workers(jobs), on_progress=on_progress)
    _finish([out], quiet, as_json)


@app.command()
def tree(
    photo: Annotated[Path, typer.Argument(help="The photograph.")],
    strokes: Annotated[Path, typer.Argument(help="Its stroke set (JSON; labelme, COCO and SVG are read too).")],
    out: Out,
    height: Annotated[float, typer.Option(help="Metres from the root to the crown's top.")] = 10.0,
    method: Annotated[str, typer.Option(help="tan2008 or tan2008_paper.")] = "tan2008",
    seed: Annotated[int, typer.Option(min=0, help="Another seed grows another tree.")] = 0,
    quiet: Quiet = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Build one tree from one photo and its strokes."""
    _start_logging(verbose)
    from forestgen.pipeline import build_scene
    from forestgen.scene.manifest import single_tree_scene

    spec = single_tree_scene(photo, strokes, height=height, method=method, seed=seed)
    with _progress([one.name for one in spec.trees], quiet or as_json) as on_progress:
        build_scene(spec, out, jobs=1, on_progress=on_progress)
    _finish([out], quiet, as_json)


@app.command()
def check(
    out: Annotated[Path, typer.Argument(help="The folder that a build wrote.")],
    jobs: Jobs = 0,
    quiet: Quiet = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Render the trees of a build again, score them, and write the report anew."""
    _start_logging(verbose)
    from forestgen.pipeline import check_output, tree_names

    with _progress(tree_names(out), quiet or as_json) as on_progress:
        check_output(out, jobs=_n_workers(jobs), on_progress=on_progress)
    _finish([out], quiet, as_json)


@app.command()
def summary(outs: Annotated[list[Path], typer.Argument(help="Folders that builds wrote.")]) -> None:
    """Print the table of trees, scores and seconds of earlier builds."""
    _finish(outs, quiet=False, as_json=False)


@app.command()
def doctor() -> None:
    """Say what this machine lacks for rendering, and how to get it."""
    from forestgen.doctor import examine

    findings = examine()
    for finding in findings:
        print(f"{'ok ' if finding.is_good else 'BAD'}  {finding.what}")
        if finding.remedy:
            print(f"     {finding.remedy}")
    if not all(finding.is_good for finding in findings):
        raise typer.Exit(NO_RENDERER)


def main() -> NoReturn:
    """Run a command; every known failure is one line on stderr and an exit code."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        app(standalone_mode=False)
    except typer.Exit as stop:  # pragma: no cover - click raises it on some paths only
        sys.exit(stop.exit_code)
    except (KeyboardInterrupt, typer.Abort):
        _complain("interrupted; what was built before is intact")
        sys.exit(INTERRUPTED)
    except RenderError as error:
        _complain(str(error))
        sys.exit(NO_RENDERER)
    except ForestgenError as error:
        _complain(str(error))
        sys.exit(BAD_INPUT)
    except OSError as error:
        _complain(f"{error.filename or 'output'}: {error.strerror or error}")
        sys.exit(BAD_INPUT)
    except Exception as error:
        if hasattr(error, "exit_code") and hasattr(error, "show"):  # click's usage errors
            error.show()
            sys.exit(error.exit_code)
        raise
    sys.exit(0)


def _complain(message: str) -> None:
    print("forestgen: " + " ".join(message.split()), file=sys.stderr)


def _start_logging(verbose: bool) -> None:
    logging.basicConfig(level=logging.INFO if verbose else logging.WARNING, format="%(name)s: %(message)s")


def _n_workers(jobs: int) -> int:
    return jobs or len(os.sched_getaffinity(0))


@contextmanager
def _progress(names: list[str], is_silent: bool) -> Iterator[OnProgress | None]:
    """One bar a tree: its name, the stage it is in, how far that stage is."""
    if is_silent:
        yield None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TextColumn("{task.fields[stage]}", markup=False),
        TimeElapsedColumn(),
    )
    from forestgen.pipeline import STEPS

    with Progress(*columns, console=_console(stderr=True)) as progress:
        tasks = [progress.add_task(name, total=len(STEPS), stage="waiting", start=False) for name in names]

        def on_progress(index: int, stage: str, done: int, total: int) -> None:
            task = tasks[index]
            progress.start_task(task)
            if stage in STEPS:
                share = done / total if total else 0.0
                label = f"{stage} {done}/{total}" if total else stage
                progress.update(task, completed=int(STEPS.index(stage) + share), stage=label)
            else:
                progress.update(task, completed=len(STEPS), stage=stage or "done")

        yield on_progress


def _console(stderr: bool = False) -> Console:
    from rich.console import Console

    return Console(stderr=stderr, highlight=False)


def _finish(outs: list[Path], quiet: bool, as_json: bool) -> None:
    """Print what the reports say and leave with 1 where a gate failed."""
    from forestgen.summary import print_summary, read_report

    reports = [read_report(out) for out in outs]
    if as_json:
        print(json.dumps(reports[0] if len(reports) == 1 else reports, indent=1, ensure_ascii=False))
    elif not quiet:
        print_summary(_console(), outs, reports)
    if not all(report["passed"] for report in reports):
        raise typer.Exit(GATE_FAILED)
