"""From photo and strokes to written USD, and its check: seconds of each part, peak memory, against the budget.

python benchmarks/tree.py [SCENE.toml ...] [--no-check]

Each tree is built in a process of its own, as `forestgen tree` does: imports, levels of detail, cards and seasons
included. The caches of compiled code are warmed by one build that is not counted. Wall seconds mean little on a
busy machine, so processor seconds stand beside them.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any

from forestgen.blas import on_one_thread

SCENES = Path(__file__).parents[1] / "scenes"
BUDGET_S, BUDGET_GB = 10.0, 1.5  # photo and strokes to written USD; peak memory: DESIGN, section 7
PARTS = ("imports", "read", "segment", "trace", "grow", "bark", "mesh", "atlas", "leaves", "levels", "write")


def build_one(manifest: Path, index: int, is_checked: bool) -> dict[str, Any]:
    """Build and write one tree of a scene in this process; seconds and memory of it."""
    start, start_cpu = perf_counter(), process_time()
    on_one_thread()
    from forestgen import pipeline
    from forestgen.finishing import finish
    from forestgen.scene.manifest import load_scene

    seconds = {"imports": perf_counter() - start}
    tree = load_scene(manifest).trees[index]
    begin = perf_counter()
    pipeline.load_source(tree.views[0])
    seconds["read"] = perf_counter() - begin
    model = pipeline.build_model(tree)
    seconds |= model.seconds
    with TemporaryDirectory() as folder:
        begin = perf_counter()
        extras = finish(model)
        seconds["levels"] = perf_counter() - begin
        begin = perf_counter()
        pipeline.write_tree(model, tree.prim_name, Path(folder) / "trees", extras)
        seconds["write"] = perf_counter() - begin
        found = {
            "name": tree.name,
            "size": model.views[0].photo.size,
            "seconds": seconds,
            "wall": perf_counter() - start,
            "cpu": process_time() - start_cpu,
            "gb": peak_gb(),
            "leaves": len(model.leaves),
        }
        if is_checked:
            from forestgen.check.output import check_job, check_tree

            begin = perf_counter()
            entry = {"name": tree.name, "prim_name": tree.prim_name}
            check_tree(check_job(Path(folder), entry, Path(folder) / "report"))
            found |= {"check": perf_counter() - begin, "check_gb": peak_gb()}
    return found


def peak_gb() -> float:
    """Peak resident memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def run_alone(manifest: Path, index: int, is_checked: bool) -> dict[str, Any]:
    """`build_one` in a process of its own."""
    words = [sys.executable, __file__, "--one", str(index), str(manifest), *([] if is_checked else ["--no-check"])]
    done = subprocess.run(words, stdout=subprocess.PIPE, check=True, env={**os.environ, "PYTHONWARNINGS": "ignore"})
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def print_table(rows: Sequence[dict[str, Any]]) -> None:
    """One row a tree, then what the worst one uses of the budget."""
    heads = ("tree", "px", *PARTS, "whole", "cpu s", "GB", "check", "GB")
    print("| " + " | ".join(heads) + " |")
    print("|---" * len(heads) + "|")
    for row in rows:
        parts = [f"{row['seconds'].get(part, 0):.2f}" for part in PARTS]
        checked = [f"{row[key]:.2f}" if key in row else "-" for key in ("check", "check_gb")]
        cells = (
            row["name"],
            "x".join(map(str, row["size"])),
            *parts,
            f"{row['wall']:.2f}",
            f"{row['cpu']:.2f}",
            f"{row['gb']:.2f}",
            *checked,
        )
        print("| " + " | ".join(cells) + " |")
    memory = max(row.get("check_gb", row["gb"]) for row in rows)
    whole = {row["name"]: row["wall"] for row in rows}
    plain = {row["name"]: row["wall"] - row["seconds"]["levels"] for row in rows}
    for what, seconds in (("--plain", plain), ("levels, cards and seasons included", whole)):
        name = max(seconds, key=lambda name: float(seconds[name]))
        within = sum(value <= BUDGET_S for value in seconds.values())
        print(f"\nphoto and strokes to written USD, {what}: {seconds[name]:.1f} s at most ({name}),", end=" ")
        print(f"{within} of {len(seconds)} within the {BUDGET_S:g} s of the budget")
    print(f"\nmemory: {memory:.2f} of {BUDGET_GB:g} GB; load of the machine {os.getloadavg()[0]:.1f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    samples = [SCENES / name / "scene.toml" for name in ("street", "woods", "garden")]
    parser.add_argument("scenes", nargs="*", type=Path, default=samples)
    parser.add_argument("--no-check", action="store_true")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one is not None:
        json.dump(build_one(options.scenes[0], options.one, not options.no_check), sys.stdout)
        return
    from forestgen import load_scene

    run_alone(options.scenes[0], 0, False)
    rows = []
    for manifest in options.scenes:
        rows += [run_alone(manifest, index, not options.no_check) for index in range(len(load_scene(manifest).trees))]
    print_table(rows)


if __name__ == "__main__":
    main()
