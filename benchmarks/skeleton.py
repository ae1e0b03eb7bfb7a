"""Does pruning by contour parts leave fewer redundant and fewer shortened branches than thinning?

    python benchmarks/skeleton.py [folder with ground_truth/]

The complaint of Kim & Jeong 2014 (fig. 4), measured on the true masks of visible wood against the true
branches, within 2 px: `precision` of the skeleton's length, `recall` of the visible branches' length;
`redundant ends`, the share and number of the skeleton's free ends that lie on no true branch; `shortened`,
the share of the true branches' visible tips that the skeleton does not reach. All edges of leaves cut wood
into parts, so that most ends are no tips.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from skimage.morphology import skeletonize

from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo, load_photo
from forestgen.tree.strokes import Strokes, load_strokes
from forestgen.tree.trace.curve_evolution import evolve, outlines_of
from forestgen.tree.trace.half_width import at_points
from forestgen.tree.trace.pruned_skeleton import PrunedSkeleton, pruned_thin
from forestgen.tree.trace.pruned_skeleton_parts import convex
from forestgen.tree.trace.smooth_paths import SmoothPaths

WITHIN = 2.0  # px
Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Case:
    """One photo of known truth."""

    photo: Photo
    strokes: Strokes
    mattes: Mattes  # the true ones
    lines: list[Points]  # true branches, points half a pixel apart


def cases(folder: Path) -> Iterator[Case]:
    """Every photo of known truth."""
    for mask in sorted(folder.glob("*/photo_az???_mask.png")):
        view = mask.stem[: len("photo_az000")]
        branches = json.loads((mask.parent / "skeleton.json").read_text())["branches"]
        lines = [np.array(branch[f"{view}_px"]) for branch in branches if f"{view}_px" in branch]
        if lines:
            share = cv2.imread(str(mask)).astype(np.float32) / 255
            strokes = load_strokes(mask.parent / f"{view.replace('photo', 'strokes')}.json")
            mattes = Mattes(share[..., 2], share[..., 1])
            yield Case(load_photo(mask.parent / f"{view}.jpg"), strokes, mattes, [dense(one) for one in lines])


def dense(line: Points) -> Points:
    """A polyline (K, 2) as points half a pixel apart."""
    along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    at = np.linspace(0, along[-1], max(2, int(2 * along[-1])))
    return np.column_stack([np.interp(at, along, line[:, k]) for k in (0, 1)])


def visible(wood: NDArray[np.bool_], lines: list[Points]) -> tuple[Points, Points]:
    """Points of the branches over visible wood (N, 2) px, and those of their tips (E, 2) that are seen."""
    seen, ends = [], []
    height, width = wood.shape
    for line in lines:
        column, row = line.astype(int).T
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        over = inside & wood[row.clip(0, height - 1), column.clip(0, width - 1)]
        seen.append(line[over])
        if over[-4:].any():
            ends.append(line[np.flatnonzero(over)[-1]])
    return np.concatenate(seen), np.array(ends).reshape(-1, 2)


def ends_of(thin: NDArray[np.bool_]) -> Points:
    """Free ends (E, 2) px of a thinned mask; of a single pixel, none."""
    count = cv2.filter2D(thin.astype(np.uint8), cv2.CV_16S, np.ones((3, 3)), borderType=cv2.BORDER_CONSTANT) - 1
    row, column = np.nonzero(thin & (count == 1))
    return np.column_stack([column, row]) + 0.5


def near(points: Points, others: Points, within: float) -> float:
    """Share of points that have another within so many px."""
    if not len(points) or not len(others):
        return float("nan")
    return float((cKDTree(others).query(points)[0] <= within).mean())


def pixels_of(thin: NDArray[np.bool_]) -> tuple[Points, Points]:
    """Places (N, 2) px of a thinned mask and its free ends (E, 2)."""
    row, column = np.nonzero(thin)
    return np.column_stack([column, row]) + 0.5, ends_of(thin)


def points_of(graph: BranchGraph, wood: NDArray[np.bool_]) -> tuple[Points, Points]:
    """Places (N, 2) px of a traced tree where wood is seen, and its tips (E, 2) there."""
    lines = [dense(graph.xy[[graph.parent[node], node]]) for node in range(1, len(graph))]
    tips = np.bincount(graph.parent[1:], minlength=len(graph)) == 0
    seen = cv2.dilate(wood.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return tuple(points[at_points(seen, points) > 0] for points in (np.concatenate(lines), graph.xy[tips]))  # type: ignore[return-value]


def measure(places: Points, ends: Points, seen: Points, every: Points, tips: Points) -> tuple[float, ...]:
    """Precision, recall; numbers of redundant ends, of ends, of shortened branches, of branches."""
    return (
        near(places, every, WITHIN),
        near(seen, places, WITHIN),
        (1 - near(ends, every, WITHIN)) * len(ends),
        len(ends),
        (1 - near(tips, places, WITHIN)) * len(tips),
        len(tips),
    )


def ragged(wood: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The mask with its edge moved by noise of 0.9 px, as a matte's may be."""
    noise = cv2.GaussianBlur(np.random.default_rng(1).normal(size=wood.shape), (0, 0), 1.2)
    inside, outside = (cv2.distanceTransform(part.astype(np.uint8), cv2.DIST_L2, 5) for part in (wood, ~wood))
    return np.asarray(inside - outside + 0.9 * noise / noise.std() > 0)


def by_parts(wood: NDArray[np.bool_], vertices: int = 0, relevance: float = 0.004) -> NDArray[np.bool_]:
    """Thinned, then pruned by the parts of the outline; by m vertices or by their relevance."""
    tall = float(np.ptp(np.flatnonzero(wood.any(axis=1))))
    contours = outlines_of(wood)
    kept = evolve(contours, whole=tall, fewest=vertices or 3, least=np.inf if vertices else relevance)
    return pruned_thin(wood, contours, convex(contours, kept))


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[2] / "shared") / "ground_truth"
    if not folder.is_dir():
        sys.exit(f"skipped: no {folder}")
    ways: dict[str, Callable[[NDArray[np.bool_]], NDArray[np.bool_]]] = {
        "thinning": lambda wood: np.asarray(skeletonize(wood.copy()), bool),
        "parts, R >= 0.002": lambda wood: by_parts(wood, relevance=0.002),
        "parts, R >= 0.004": by_parts,
        "parts, R >= 0.008": lambda wood: by_parts(wood, relevance=0.008),
        "parts, m = 300": lambda wood: by_parts(wood, vertices=300),
        "parts, m = 1000": lambda wood: by_parts(wood, vertices=1000),
    }
    tracers: dict[str, SmoothPaths] = {
        "smooth paths": SmoothPaths(),
        "pruned skeleton, R >= 0.002": PrunedSkeleton(relevance=0.002),
        "pruned skeleton": PrunedSkeleton(),
        "pruned skeleton, m = 300": PrunedSkeleton(vertices=300),
    }
    for title, spoil in (("true masks", np.asarray), ("true masks with ragged edges", ragged)):
        rows: dict[str, list[tuple[float, ...]]] = {way: [] for way in [*ways, *tracers]}
        for case in cases(folder):
            wood = case.mattes.is_branch
            (seen, tips), mask, every = visible(wood, case.lines), spoil(wood), np.concatenate(case.lines)
            spoiled = Mattes(np.where(mask, 0, case.mattes.foliage), mask.astype(np.float32))
            for way, skeleton in ways.items():
                start = process_time()
                thin = skeleton(mask)
                rows[way].append((*measure(*pixels_of(thin), seen, every, tips), process_time() - start))
            for way, tracer in tracers.items():
                start = process_time()
                graph = tracer(case.photo, case.strokes, spoiled, rng=np.random.default_rng(0))
                rows[way].append((*measure(*points_of(graph, mask), seen, every, tips), process_time() - start))
        print(f"\n{title}: {len(rows['thinning'])} photos; below, whole traced trees where wood is seen")
        print("| skeleton | precision | recall | redundant ends | shortened branches | seconds a photo |")
        print("| --- | ---: | ---: | ---: | ---: | ---: |")
        for way, found in rows.items():
            precision, recall, *_, spent = np.mean(found, axis=0)
            off, ends, short, branches = np.sum(found, axis=0)[2:6]
            print(f"| {way} | {precision:.3f} | {recall:.3f} | {off:.0f} of {ends:.0f} = {off / ends:.1%}", end="")
            print(f" | {short:.0f} of {branches:.0f} = {short / branches:.1%} | {spent:.2f} |")


if __name__ == "__main__":
    main()
