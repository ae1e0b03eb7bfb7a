"""Matting: how well does each segmenter know the share of every pixel that is tree, against the true masks?

    python benchmarks/matting.py SHARED_FOLDER [TREE ...]

Columns: IoU of the tree at one half, IoU of its envelope, mean squared and mean absolute error of
alpha inside the true envelope in percent, seconds of processor time. Peer: the graph cut.
The plain closed form is the paper's: nothing but the trimap and the matting Laplacian.
"""

from __future__ import annotations

import resource
import sys
from pathlib import Path
from time import process_time

import cv2
import numpy as np
from numpy.typing import NDArray
from segmentation import Case, cases, overlap

from forestgen.arrays import stage_rng
from forestgen.check.metrics import envelope
from forestgen.tree.segment import Segment
from forestgen.tree.segment.closed_form import ClosedFormMatte
from forestgen.tree.segment.graph_cut import GraphCutFoliage

WAYS: dict[str, Segment] = {
    "graph cut": GraphCutFoliage(),
    "closed form": ClosedFormMatte(),
    "without open sky": ClosedFormMatte(open_sky=False),
    "plain closed form": ClosedFormMatte(open_sky=False, pull=0.0),
}


def true_alpha(shared: Path, name: str) -> NDArray[np.float32]:
    """Share (H, W) of each pixel that is tree, of the photo with this name in `cases`."""
    folder, view = name.split()
    mask = f"mask_{view}.png" if folder == "woods" else f"photo_{view}_mask.png"
    leaf_and_wood = cv2.imread(str(shared / "ground_truth" / folder / mask))[..., 1:]
    return np.minimum(leaf_and_wood.sum(axis=2, dtype=np.float32) / 255, 1)


def score(case: Case, truth: NDArray[np.float32], way: Segment) -> tuple[float, ...]:
    start = process_time()
    mattes = way(case.photo, case.strokes, rng=stage_rng(0, "segment", 0))
    seconds = process_time() - start
    alpha = np.minimum(mattes.foliage + mattes.branch, 1)
    tall = float(np.ptp(np.flatnonzero(case.is_tree.any(axis=1))))
    inside = envelope(case.is_tree, tall)
    wrong = (alpha - truth)[inside]
    return (
        overlap(mattes.is_tree, case.is_tree),
        overlap(envelope(mattes.is_tree, tall), inside),
        100 * float((wrong**2).mean()),
        100 * float(np.abs(wrong).mean()),
        seconds,
    )


def main() -> None:
    shared = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2] / "shared"
    wanted = sys.argv[2:]
    if not (shared / "ground_truth").is_dir():
        print("skipped: no folder 'shared' with ground truth beside this checkout")
        return
    trees = cases(shared, wanted)
    WAYS["closed form"](trees[0].photo, trees[0].strokes, rng=stage_rng(0, "segment", 0))  # PyMatting compiles
    print(f"{'':20}" + "".join(f"{name:>34}" for name in WAYS))
    total = []
    for case in trees:
        truth = true_alpha(shared, case.name)
        row = [score(case, truth, way) for way in WAYS.values()]
        total.append(row)
        print(f"{case.name:20}" + "".join(f"{_cells(s):>34}" for s in row), flush=True)
    mean = np.mean(total, axis=0)
    print(f"{'mean':20}" + "".join(f"{_cells(s):>34}" for s in mean))
    for name, ratio in zip(WAYS, mean[:, 4] / mean[0, 4], strict=True):
        print(f"{name}: {ratio:.2f} of the graph cut's time")
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


def _cells(s: tuple[float, ...]) -> str:
    return f"{s[0]:.3f} {s[1]:.3f} {s[2]:5.2f} {s[3]:5.2f} {s[4]:5.1f} s"


if __name__ == "__main__":
    main()
