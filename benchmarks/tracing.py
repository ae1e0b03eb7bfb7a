"""How much of the truly visible wood does each tracer find, and how fast?

    python benchmarks/tracing.py [folder with ground_truth/]

F: F-score within 2 px of the drawn graph against the true mask of visible wood, with the true mattes.
Time: a stroke of the circle against its budget of 100 ms; a whole trace against the same mask thinned
by scikit-image, in the same run.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.morphology import skeletonize

from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import load_photo
from forestgen.tree.radius import constant_ratio
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strokes import load_strokes
from forestgen.tree.trace.circle_tracing import CircleTracing, trace_stroke
from forestgen.tree.trace.drafting import Draft
from forestgen.tree.trace.smooth_paths import SmoothPaths

WITHIN = 2.0  # px
BUDGET = 0.1  # s a stroke


def cases(folder: Path) -> Iterator[tuple[str, Path, Path, Path]]:
    """(name, photo, strokes, mask) of every photo of known truth."""
    for photo in sorted(folder.glob("*/photo_az???.jpg")):
        strokes = photo.with_name(photo.name.replace("photo", "strokes")).with_suffix(".json")
        yield f"{photo.parent.name} {photo.stem[-3:]}", photo, strokes, photo.with_name(f"{photo.stem}_mask.png")
    for strokes in sorted(folder.glob("woods/strokes_*.json")):
        mask = strokes.with_name(strokes.name.replace("strokes", "mask")).with_suffix(".png")
        yield f"woods {strokes.stem[8:]}", strokes.with_name("photo.jpg"), strokes, mask


def draw(graph: BranchGraph, size: tuple[int, int]) -> NDArray[np.bool_]:
    """The graph as tapering edges (H, W); hidden parts thin out from the last measured radius."""
    radius = graph.radius_px.copy()
    mask = np.zeros(size[::-1], np.uint8)
    for node in range(1, len(graph)):
        above = graph.parent[node]
        if np.isnan(radius[node]):
            radius[node] = max(1.0, 0.9 * radius[above])
        steps = int(np.hypot(*(graph.xy[node] - graph.xy[above]))) + 2
        for share in np.linspace(0, 1, steps):
            x, y = graph.xy[above] + share * (graph.xy[node] - graph.xy[above]) - 0.5
            r = radius[above] + share * (radius[node] - radius[above])
            cv2.circle(mask, (round(x * 8), round(y * 8)), round(max(r, 0.5) * 8), 1, -1, shift=3)
    return mask > 0


def f_score(true: NDArray[np.bool_], drawn: NDArray[np.bool_]) -> tuple[float, float, float]:
    """F, precision, recall within 2 px."""
    to_true = cv2.distanceTransform((~true).astype(np.uint8), cv2.DIST_L2, 5)
    to_drawn = cv2.distanceTransform((~drawn).astype(np.uint8), cv2.DIST_L2, 5)
    precision, recall = float((to_true[drawn] <= WITHIN).mean()), float((to_drawn[true] <= WITHIN).mean())
    return 2 * precision * recall / max(precision + recall, 1e-9), precision, recall


def paper_radius(graph: BranchGraph) -> BranchGraph:
    """The paper's 75 % a generation, so that the circle's graph can be drawn."""
    flat = Skeleton(np.column_stack([graph.xy, np.zeros(len(graph))]), graph.parent, graph.radius_px)
    return BranchGraph(graph.xy, graph.parent, constant_ratio(flat, 0.75))


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[2] / "shared") / "ground_truth"
    if not folder.is_dir():
        sys.exit(f"skipped: no {folder}")
    print(f"{'':18} {'circle tracing':^32} | {'smooth paths':^42}")
    print(f"{'tree':18} {'F':>5} {'prec':>5} {'rec':>5} {'stroke':>8} {'budget':>6} | ", end="")
    print(f"{'F':>5} {'prec':>5} {'rec':>5} {'trace':>8} {'/thinning':>9} nodes")
    rows = []
    for name, photo_path, strokes_path, mask_path in cases(folder):
        photo, strokes = load_photo(photo_path), load_strokes(strokes_path)
        mask = cv2.imread(str(mask_path)).astype(np.float32) / 255
        mattes, true = Mattes(mask[..., 2], mask[..., 1]), mask[..., 1] >= 0.5
        circle, smooth = CircleTracing(), SmoothPaths()
        models = circle.prepare(photo, strokes, mattes, rng=np.random.default_rng(0))
        draft, slowest = Draft(strokes.root), 0.0
        for path in strokes.branches:
            start = perf_counter()
            trace_stroke(models, draft, path, circle.spacing)
            slowest = max(slowest, perf_counter() - start)
        graph = circle(photo, strokes, mattes, rng=np.random.default_rng(0))
        first = f_score(true, draw(paper_radius(graph), photo.size))
        model = smooth.prepare(mattes, strokes)
        start = perf_counter()
        ours = smooth.trace(model, strokes)
        spent = perf_counter() - start
        wood = model.wood.copy()
        start = perf_counter()
        skeletonize(wood)
        peer = perf_counter() - start
        second = f_score(true, draw(ours, photo.size))
        rows.append((*first, slowest, *second, spent, spent / peer))
        print(f"{name:18} {first[0]:5.2f} {first[1]:5.2f} {first[2]:5.2f} {slowest * 1e3:5.0f} ms", end="")
        print(f" {slowest / BUDGET:5.0%} | {second[0]:5.2f} {second[1]:5.2f} {second[2]:5.2f}", end="")
        print(f" {spent * 1e3:5.0f} ms {spent / peer:9.1f} {len(ours):5}")
    mean = np.mean(rows, axis=0)
    print(f"{'mean':18} {mean[0]:5.2f} {mean[1]:5.2f} {mean[2]:5.2f} {mean[3] * 1e3:5.0f} ms", end="")
    print(f" {mean[3] / BUDGET:5.0%} | {mean[4]:5.2f} {mean[5]:5.2f} {mean[6]:5.2f}", end="")
    print(f" {mean[7] * 1e3:5.0f} ms {mean[8]:9.1f}")


if __name__ == "__main__":
    main()
