"""The commands. Thin: they parse, show progress and print; heavy imports happen inside them."""

from __future__ import annotations

import json
import logging
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from forestgen.blas import on_one_thread
from forestgen.complaints import in_words
from forestgen.errors import ForestgenError, RenderError, StageError
from forestgen.interrupts import raise_on_signals

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
Delit = Annotated[bool, typer.Option("--delit", help="Add the variant light=delit: leaves without the photo's light.")]
OpenPBR = Annotated[bool, typer.Option("--openpbr", help="Add the variant look=openpbr: leaves let light through.")]
Plain = Annotated[bool, typer.Option("--plain", help="Leave out levels of detail, cards, seasons: a third less time.")]
Root = Annotated[Path | None, typer.Option(help="Folder that the manifest's paths may climb up to.")]

GATE_FAILED, BAD_INPUT, NO_RENDERER, INTERRUPTED = 1, 2, 3, 130
BROKEN_PIPE = 141  # as a shell says it of a program that SIGPIPE ended
FILE_WIDTH = 140  # columns of a table that goes to a file


@app.command()
def build(
    scene: Annotated[Path, typer.Argument(help="The scene manifest (TOML).")],
    out: Out,
    root: Root = None,
    instancing: Annotated[
        str, typer.Option(help="What trees become: native prims, points of an instancer, or auto: points above 1,000.")
    ] = "auto",
    delit: Delit = False,
    openpbr: OpenPBR = False,
    plain: Plain = False,
    jobs: Jobs = 0,
    quiet: Quiet = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Build every tree of a scene, its USD stage, and the report that scores it."""
    _start_logging(verbose)
    from forestgen.finishing import Finish
    from forestgen.pipeline import build_scene
    from forestgen.scene.manifest import load_scene

    spec = load_scene(scene, root)
    with _progress([tree.name for tree in spec.trees], quiet or as_json or verbose) as on_progress:
        build_scene(
            spec,
            out,
            instancing=instancing,
            wanted=Finish(delit, openpbr, plain),
            jobs=_n_workers(jobs),
            on_progress=on_progress,
        )
    _finish([out], quiet, as_json)


@app.command()
def tree(
    photo: Annotated[Path, typer.Argument(help="The photograph.")],
    strokes: Annotated[Path, typer.Argument(help="Its stroke set (JSON; labelme, COCO and SVG are read too).")],
    out: Out,
    height: Annotated[float, typer.Option(help="Metres from the root to the crown's top.")] = 10.0,
    method: Annotated[str, typer.Option(help="tan2008, neubert2007 or kim2014, each also as NAME_paper.")] = "tan2008",
    seed: Annotated[int, typer.Option(min=0, help="Another seed grows another tree.")] = 0,
    evergreen: Annotated[bool, typer.Option("--evergreen", help="It keeps its leaves green all year.")] = False,
    delit: Delit = False,
    openpbr: OpenPBR = False,
    plain: Plain = False,
    quiet: Quiet = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Build one tree from one photo and its strokes."""
    _start_logging(verbose)
    from forestgen.finishing import Finish
    from forestgen.pipeline import build_scene
    from forestgen.scene.manifest import single_tree_scene

    spec = single_tree_scene(photo, strokes, height=height, method=method, seed=seed, evergreen=evergreen)
    with _progress([one.name for one in spec.trees], quiet or as_json or verbose) as on_progress:
        build_scene(spec, out, wanted=Finish(delit, openpbr, plain), jobs=1, on_progress=on_progress)
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

    with _progress(tree_names(out), quiet or as_json or verbose) as on_progress:
        check_output(out, jobs=_n_workers(jobs), on_progress=on_progress)
    _finish([out], quiet, as_json)


@app.command()
def vary(
    tree: Annotated[Path, typer.Argument(help="The folder of a tree that a build wrote: OUT/trees/NAME.")],
    seeds: Annotated[int, typer.Option(min=1, max=64, help="How many variations to grow.")] = 8,
    root: Annotated[Path | None, typer.Option(help="The scene's root folder, where a setting names a folder.")] = None,
    jobs: Jobs = 0,
    quiet: Quiet = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Grow a tree anew from other seeds: assets and a contact sheet below its folder."""
    _start_logging(verbose)
    from forestgen.variation import STEPS, read_tree, vary_tree

    first = read_tree(tree).seed + 1
    names = [f"seed {seed}" for seed in range(first, first + seeds)]
    with _progress(names, quiet or as_json or verbose, STEPS) as on_progress:
        made = vary_tree(tree, seeds, root=root, jobs=_n_workers(jobs), on_progress=on_progress)
    if as_json:
        print(json.dumps(made, indent=1))
    elif not quiet:
        for one in made["variations"]:
            print(f"seed {one['seed']:<6} {tree / one['asset'] if 'asset' in one else one['error']}")
        print(f"{'sheet':11} {tree / made['sheet']}")
    if not made["passed"]:
        raise typer.Exit(GATE_FAILED)


@app.command()
def grow(
    tree: Annotated[Path, typer.Argument(help="The folder of a tree that a build wrote: OUT/trees/NAME.")],
    frames: Annotated[int, typer.Option(help="Length of the film.")] = 180,
    fps: Annotated[float, typer.Option(help="Frames a second.")] = 24.0,
    mode: Annotated[
        str, typer.Option(help="all: thickness, size and order; none: no scaling; scale: only that.")
    ] = "all",
    tropism: Annotated[float, typer.Option(help="Degrees a branch bends in its life; above 0 it lifts.")] = -7.0,
    tolerance: Annotated[float, typer.Option(help="How far samples may stray, as a share of the height.")] = 0.005,
    every_frame: Annotated[bool, typer.Option("--every-frame", help="Write a sample for each frame.")] = False,
    film: Annotated[bool, typer.Option(help="Draw the report's film strip and preview, and check again.")] = True,
    quiet: Quiet = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Add its growth over time to a tree's asset, as a variant; any method's tree can grow."""
    _start_logging(verbose)
    from forestgen.growing import grow_and_show
    from forestgen.tree.growth import Growth

    growth = Growth(mode=mode, tropism_deg=tropism)
    with _progress([tree.name], quiet or as_json or verbose, ("grow", "film", "check")) as on_progress:
        made = grow_and_show(
            tree, growth, frames=frames, fps=fps, tolerance=tolerance, every_frame=every_frame, film=film,
            on_progress=on_progress,
        )  # fmt: skip
    if as_json:
        print(json.dumps(made.summary(), indent=1))
    elif not quiet:
        print(made.words())


@app.command()
def summary(outs: Annotated[list[Path], typer.Argument(help="Folders that builds wrote.")]) -> None:
    """Print the table of trees, scores and seconds of earlier builds."""
    _finish(outs, quiet=False, as_json=False)


@app.command()
def export(
    source: Annotated[Path, typer.Argument(help="A tree, OUT/trees/NAME, or a whole build, OUT.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder to write to.")],
    profile: Annotated[str, typer.Option(help="usd, blender, web, arkit, unreal, glb or obj.")] = "usd",
    level: Annotated[int | None, typer.Option(help="Level of detail where one is held; 0 is finest.")] = None,
    max_triangles: Annotated[int | None, typer.Option(help="Most triangles of the finest level.")] = None,
    max_instances: Annotated[int | None, typer.Option(help="Most leaves of the finest level.")] = None,
    season: Annotated[str | None, typer.Option(help="photo, summer, autumn or winter, where one is held.")] = None,
    variant: Annotated[
        list[str] | None, typer.Option(help="SET=VARIANT to select first, such as season=autumn; may be repeated.")
    ] = None,
    instancing: Annotated[bool, typer.Option(help="glb: keep leaves as instances.")] = True,
    rig: Annotated[bool, typer.Option("--rig", help="usd: a skinned tree beside it.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Make a written tree or scene over for one kind of reader."""
    from forestgen.exporting import Wishes, export, parse_variants

    wishes = Wishes(
        level=level,
        max_triangles=max_triangles,
        max_instances=max_instances,
        season=season,
        variants=parse_variants(variant or []),
        instancing=instancing,
        rig=rig,
    )
    files = export(source, out, profile, wishes)
    if as_json:
        print(json.dumps([str(file) for file in files], indent=1))
    elif not quiet:
        for file in files:
            print(f"{file}: {file.stat().st_size / 1e6:.1f} MB")


@app.command()
def validate(
    file: Annotated[Path, typer.Argument(help="Any USD file.")],
    as_json: Json = False,
) -> None:
    """Check a USD file: USD's own validators and what none of them checks, in every variant of its default prim."""
    from forestgen.usd.validate import validate_file

    findings = validate_file(file)
    if as_json:
        print(json.dumps([asdict(finding) for finding in findings], indent=1))
    else:
        for finding in findings:
            print(finding.line())
        print(f"{file}: {len(findings) or 'no'} finding{'s' * (len(findings) != 1)}")
    if findings:
        raise typer.Exit(GATE_FAILED)


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
    raise_on_signals()
    on_one_thread()
    for stream in (sys.stdout, sys.stderr):  # names may hold what the terminal's encoding does not
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    sys.exit(_run())


def _run() -> int:
    """Run the command of sys.argv; returns its exit code."""
    try:
        code = int(app(standalone_mode=False) or 0)  # typer makes KeyboardInterrupt an exit code
        if code == INTERRUPTED:
            raise KeyboardInterrupt
        sys.stdout.flush()
        return code
    except (KeyboardInterrupt, typer.Abort):
        _complain("interrupted; what was built before is intact")
        return INTERRUPTED
    except RenderError as error:
        _complain(str(error))
        return NO_RENDERER
    except StageError as error:
        _complain(str(error))
        return GATE_FAILED
    except ForestgenError as error:
        _complain(str(error))
        return BAD_INPUT
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python complains when it ends
        return BROKEN_PIPE
    except OSError as error:
        _complain(in_words(error))
        return BAD_INPUT
    except Exception as error:
        if hasattr(error, "exit_code") and hasattr(error, "show"):  # click's usage errors
            error.show()
            return int(error.exit_code)
        raise


def _complain(message: str) -> None:
    print("forestgen: " + " ".join(message.split()), file=sys.stderr)


def _start_logging(verbose: bool) -> None:
    logging.basicConfig(format="%(name)s: %(message)s")
    logging.getLogger("forestgen").setLevel(logging.INFO if verbose else logging.WARNING)


def _n_workers(jobs: int) -> int:
    return jobs or len(os.sched_getaffinity(0))


@contextmanager
def _progress(names: list[str], is_silent: bool, steps: Sequence[str] | None = None) -> Iterator[OnProgress | None]:
    """Show progress on stderr, in the steps of a build or others, unless nobody wants it."""
    if is_silent:
        yield None
        return
    from forestgen.progress import shown_progress

    if steps is None:
        from forestgen.pipeline import STEPS

        steps = STEPS
    with shown_progress(names, steps, _console(stderr=True)) as on_progress:
        yield on_progress


def _console(stderr: bool = False) -> Console:
    """A terminal as wide as it is; a file or pipe is as wide as need be."""
    from rich.console import Console

    console = Console(stderr=stderr, highlight=False)
    return console if console.is_terminal else Console(stderr=stderr, highlight=False, width=FILE_WIDTH)


def _finish(outs: list[Path], quiet: bool, as_json: bool) -> None:
    """Print what the reports say and leave with 1 where a gate failed."""
    from forestgen.summary import print_summary, read_report

    reports = [read_report(out) for out in outs]
    if as_json:
        print(json.dumps(reports[0] if len(reports) == 1 else reports, indent=1))
    elif not quiet:
        print_summary(_console(), outs, reports)
    if not all(report["passed"] for report in reports):
        raise typer.Exit(GATE_FAILED)
