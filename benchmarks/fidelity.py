"""How well do built trees match: known truth seen from all sides, and real photos through their cameras?

    python benchmarks/fidelity.py [--method tan2008] [--method tan2008_paper] [--only NAME] [--set truth|photos]
                                  [--jobs N] [--keep DIR] [--pictures DIR]
    python benchmarks/fidelity.py --floors tests/photo_floors.json

Reads the folder `shared` beside the checkout and prints GitHub-Markdown tables. Trees of known truth
are scored by its independent `tools/score_tree.py` beside the null models; real trees by our own check.
`--keep` leaves the built scenes in a folder; `--pictures` writes one strip a tree (photo, render,
front, side, back, above): no picture made from those photos may enter the repository. `--floors`
measures the trees of that file anew with tan2008 and writes what they reach: tests/test_photos.py
lets no later version fall behind.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from statistics import fmean, median
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np

from forestgen.check.score import MEASURES
from forestgen.pipeline import build_scene
from forestgen.scene.manifest import Scene, TreeSpec, load_scene, single_tree_scene
from forestgen.tree.methods import METHODS

SHARED = Path(__file__).parents[2] / "shared"
MANIFESTS = ("street", "woods", "roadside")
LEFT_OUT = {"pine_back"}  # its README: hard on purpose, not part of the medians
SEED = 7
TARGETS = {"envelope_iou": 0.95, "skill": 0.55, "boundary_f": 0.92, "branch_chamfer": 0.008, "colour_delta_e": 5.0}
SIDES = ("front", "side", "back", "above")
STRIP_HEIGHT = 420  # px


def truth_scene(shared: Path, method: str, only: Sequence[str] = ()) -> Scene | None:
    """A scene of all single trees of known truth, each from its front photo; None where `only` names none."""
    folder = shared / "ground_truth"
    trees: list[TreeSpec] = []
    for truth in sorted(folder.glob("*/truth.json")):
        if not (truth.parent / "photo_az000.jpg").is_file() or (only and truth.parent.name not in only):
            continue  # the wood: one photo of several trees, no truth from other sides
        scene = single_tree_scene(
            truth.parent / "photo_az000.jpg",
            truth.parent / "strokes_az000.json",
            height=json.loads(truth.read_text())["height_m"],
            name=truth.parent.name,
            method=method,
            seed=SEED + len(trees),
        )
        trees.append(scene.trees[0])
    return Scene("truth", SEED, folder / "truth.toml", folder.resolve(), tuple(trees)) if trees else None


def photo_scenes(shared: Path, method: str, only: Sequence[str] = ()) -> list[Scene]:
    """The scenes of real photographs, without the trees that are left out of the medians unless they are named."""

    def is_wanted(tree: TreeSpec) -> bool:
        return tree.name in only if only else tree.name not in LEFT_OUT

    scenes = []
    for name in MANIFESTS:
        scene = load_scene(shared / "photos" / f"{name}.toml")
        trees = [tree for tree in scene.trees if is_wanted(tree)]
        trees = [replace(tree, method=METHODS[method], method_name=method) for tree in trees]
        if trees:
            scenes.append(replace(scene, trees=tuple(trees)))
    return scenes


def score_truth(shared: Path, usd: Path, name: str) -> dict[str, Any]:
    """What the independent scorer says of a written tree, run as a program of its own.

    Raises:
        subprocess.CalledProcessError: it could not read the tree.
    """
    command = [sys.executable, str(shared / "tools" / "score_tree.py"), str(usd), str(shared / "ground_truth" / name)]
    return dict(json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout))


def score_all(shared: Path, out: Path, scene: Scene, jobs: int) -> dict[str, dict[str, Any]]:
    """The independent scorer's figures of every tree of a built scene, by name; one that was not built is left out."""
    usd = {tree.name: out / "trees" / tree.prim_name / f"{tree.prim_name}.usda" for tree in scene.trees}
    usd = {name: path for name, path in usd.items() if path.is_file()}
    with ThreadPoolExecutor(jobs) as pool:  # each thread waits for a program
        return dict(zip(usd, pool.map(lambda name: score_truth(shared, usd[name], name), usd), strict=True))


def truth_table(report: Mapping[str, Any], scored: Mapping[str, Mapping[str, Any]]) -> str:
    """Front and unseen sides of trees of known truth, beside the null; then means over all trees."""
    columns: dict[str, Callable[[str], float | None]] = {
        "photo envelope": lambda name: scored[name]["views"]["photo_0"]["envelope_iou"],
        "photo skill": lambda name: None if is_bare(trees[name]) else scored[name]["views"]["photo_0"]["skill"],
        "photo boundary F": lambda name: scored[name]["views"]["photo_0"]["boundary_f"],
        "wood F": lambda name: scored[name]["views"]["photo_0"]["wood_f"],
        "unseen sides": lambda name: scored[name]["unseen_envelope_iou"],
        "null (turned outline)": lambda name: scored[name]["unseen_revolve_iou"],
        "above null": lambda name: scored[name]["unseen_envelope_iou"] - scored[name]["unseen_revolve_iou"],
    }
    trees = {tree["name"]: tree for tree in report["trees"]}
    rows = [[name, *(column(name) for column in columns.values())] for name in trees if name in scored]
    means = column_means(rows)
    wanted = ["target", 0.93, 0.5, None, 0.6, None, None, -0.02]
    return markdown(["tree", *columns], [*rows, ["**mean**", *means], wanted])


def column_means(rows: Sequence[Sequence[Any]]) -> list[float | None]:
    columns = list(zip(*rows, strict=True))[1:]
    return [fmean(known) if (known := [v for v in column if v is not None]) else None for column in columns]


def is_bare(tree: Mapping[str, Any]) -> bool:
    return bool(tree["views"]) and bool(tree["views"][0]["bare"])


def own_table(reports: Sequence[Mapping[str, Any]]) -> str:
    """All measures of DESIGN section 6 a tree, with seconds, leaves and failed gates; then medians."""
    head = ["tree", *MEASURES, "seconds", "leaves", "failed gates"]
    rows: list[list[Any]] = []
    for tree in (tree for report in reports for tree in report["trees"]):
        if not tree["views"]:
            rows.append([tree["name"], *[None] * (len(MEASURES) + 2), tree.get("error", "not built")])
            continue
        view = tree["views"][0]
        spent = round(sum(tree["seconds"].values()), 1)
        rows.append(
            [
                tree["name"],
                *(view[name] for name in MEASURES),
                spent,
                tree["counts"]["leaves"],
                ", ".join(tree["failed"]),
            ]
        )
    middle = [_median([row[k] for row in rows]) for k in range(1, len(MEASURES) + 1)]
    n_failed = sum(bool(row[-1]) for row in rows)
    rows.append(["**median**", *middle, None, None, f"{n_failed} of {len(rows)} trees"])
    rows.append(["target", *(TARGETS.get(name) for name in MEASURES), None, None, None])
    return markdown(head, rows)


def _median(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return median(known) if known else None


def markdown(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A GitHub-Markdown table."""
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *([_cell(value) for value in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.4f}" if abs(value) < 1 else f"{value:.2f}"
    return str(value)


def measure_floors(shared: Path, path: Path, jobs: int, out: Path) -> None:
    """Build the trees that a file of floors names and write what they reach now."""
    floors = json.loads(path.read_text())
    for scene in photo_scenes(shared, "tan2008", list(floors["photos"])):
        floors["photos"] |= photo_figures(build_scene(scene, out / scene.prim_name, jobs=jobs))
    if truth := truth_scene(shared, "tan2008", list(floors["truth"])):
        build_scene(truth, out / "truth", jobs=jobs)
        floors["truth"] |= truth_figures(score_all(shared, out / "truth", truth, jobs))
    path.write_text(json.dumps(floors, indent=1) + "\n")


def photo_figures(report: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """By tree, the measures of our own check that have a target."""
    return {tree["name"]: {name: tree["views"][0][name] for name in TARGETS} for tree in report["trees"]}


def truth_figures(scored: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """By tree, the independent scorer's figures of the photo's side and of the unseen sides."""
    return {
        name: {
            **{key: row["views"]["photo_0"][key] for key in ("envelope_iou", "boundary_f", "wood_f")},
            "unseen_envelope_iou": row["unseen_envelope_iou"],
        }
        for name, row in scored.items()
    }


def write_strips(out: Path, scene: Scene, folder: Path, prefix: str) -> None:
    """One picture a tree: photo, render, and the tree lit from the front, the side, the back and above."""
    folder.mkdir(parents=True, exist_ok=True)
    for tree in scene.trees:
        album = out / "report" / tree.prim_name
        files = [album / f"{name}.jpg" for name in ("00_photo", "00_render", *SIDES)]
        pictures = [picture for file in files if (picture := cv2.imread(str(file))) is not None]
        if pictures:
            strip = [cv2.resize(p, (round(p.shape[1] * STRIP_HEIGHT / p.shape[0]), STRIP_HEIGHT)) for p in pictures]
            cv2.imwrite(str(folder / f"{prefix}_{tree.prim_name}.png"), np.hstack(strip))


@contextmanager
def workplace(keep: Path | None) -> Iterator[Path]:
    """The folder to build in: the one to keep, or one that goes away."""
    if keep is not None:
        yield keep
        return
    with TemporaryDirectory(prefix="fidelity_") as folder:
        yield Path(folder)


def run(shared: Path, method: str, options: argparse.Namespace, out: Path) -> None:
    """Build and print one method's tables."""
    if options.set in (None, "truth") and (scene := truth_scene(shared, method, options.only)):
        report = build_scene(scene, out / "truth", jobs=options.jobs)
        print(f"\n## {method}: trees of known truth, seen by the independent scorer\n")
        print(truth_table(report, score_all(shared, out / "truth", scene, options.jobs)))
        print(f"\n### {method}: the same trees by our own check\n\n{own_table([report])}", flush=True)
        if options.pictures:
            write_strips(out / "truth", scene, options.pictures, f"{method}_truth")
    if options.set in (None, "photos") and (scenes := photo_scenes(shared, method, options.only)):
        reports = []
        for scene in scenes:
            reports.append(build_scene(scene, out / scene.prim_name, jobs=options.jobs))
            if options.pictures:
                write_strips(out / scene.prim_name, scene, options.pictures, f"{method}_{scene.prim_name}")
        print(f"\n## {method}: real photographs\n\n{own_table(reports)}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--method", action="append", choices=sorted(METHODS), help="default: all")
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="a tree; may be repeated")
    parser.add_argument("--set", choices=("truth", "photos"), help="default: both")
    parser.add_argument("--floors", type=Path, metavar="FILE", help="only measure the floors of the tests anew")
    parser.add_argument("--jobs", type=int, default=2, help="worker processes")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="leave the built scenes here")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="write a strip of pictures a tree")
    options = parser.parse_args()
    if not (SHARED / "ground_truth").is_dir():
        print(f"skipped: there is no folder '{SHARED.name}' with photographs and ground truth beside this checkout")
        return
    with workplace(options.keep) as folder:
        if options.floors:
            measure_floors(SHARED, options.floors, options.jobs, folder / "floors")
            return
        for method in options.method or sorted(METHODS):
            run(SHARED, method, options, folder / method)


if __name__ == "__main__":
    main()
