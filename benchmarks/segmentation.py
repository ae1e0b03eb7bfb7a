"""Segmentation: rule x photo against the true masks, with seconds, and OpenCV's GrabCut as the peer.

    python benchmarks/segmentation.py SHARED_FOLDER [TREE ...]

Columns of a rule: IoU of the whole tree at one half, IoU of its envelope, F-score of wood (2 px), seconds.
The last columns vary the smoothness: the paper's 60 against ours. Below, for the default: of the wood found
in the crown how much is wood and not leaf, and how much of the wood that shows there is found, pixel by pixel.

Real photographs have no true masks. Their table says what can be said without, for two rules: the share
that is tree of the crown stroke's inside and of a ring just outside it (10 px at 1500 px), where there
should be little; the median difference (CIEDE2000) of the colours on the two sides of the matte's edge,
which is high where the edge lies on the tree's; and the IoU of the two rules' trees.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import stage_rng
from forestgen.check.metrics import envelope
from forestgen.scene.manifest import load_scene
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo, load_photo
from forestgen.tree.segment.graph_cut import GraphCutFoliage
from forestgen.tree.segment.region import dilations_px
from forestgen.tree.strokes import Strokes, draw_polyline, fill_outline, load_strokes

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Case:
    name: str
    photo: Photo
    strokes: Strokes
    is_tree: Mask
    is_wood: Mask
    is_leaf: Mask  # and no wood


def cases(shared: Path, wanted: list[str]) -> list[Case]:
    """Every photo of the ground truth that has a mask."""
    found = []
    for drawn in sorted((shared / "ground_truth").glob("*/strokes_*.json")):
        view = drawn.stem.removeprefix("strokes_")
        in_woods = drawn.parent.name == "woods"
        photo = drawn.parent / ("photo.jpg" if in_woods else f"photo_{view}.jpg")
        mask = drawn.parent / (f"mask_{view}.png" if in_woods else f"photo_{view}_mask.png")
        name = f"{drawn.parent.name} {view}"
        if wanted and not any(word in name for word in wanted):
            continue
        truth = cv2.imread(str(mask))[..., ::-1].astype(int)
        found.append(
            Case(
                name,
                load_photo(photo),
                load_strokes(drawn),
                truth[..., 0] + truth[..., 1] >= 128,
                truth[..., 1] >= 128,
                (truth[..., 0] >= 128) & (truth[..., 1] < 128),
            )
        )
    return found


def grab_cut(photo: Photo, strokes: Strokes) -> Mattes:
    """The peer: inside the crown probably tree, under the strokes tree, elsewhere background."""
    trimap = np.where(fill_outline(strokes.crown, photo.size), cv2.GC_PR_FGD, cv2.GC_BGD).astype(np.uint8)
    for path in strokes.branches:
        trimap[draw_polyline(path, photo.size, 5)] = cv2.GC_FGD
    cv2.setRNGSeed(0)
    cv2.grabCut(
        photo.rgb[..., ::-1].copy(), trimap, None, np.zeros((1, 65)), np.zeros((1, 65)), 5, cv2.GC_INIT_WITH_MASK
    )
    is_tree = np.isin(trimap, [cv2.GC_FGD, cv2.GC_PR_FGD])
    return Mattes(is_tree.astype(np.float32), np.zeros(is_tree.shape, np.float32))


def by(method: GraphCutFoliage) -> Callable[[Photo, Strokes], Mattes]:
    return lambda photo, strokes: method(photo, strokes, rng=stage_rng(0, "segment", 0))


RULES: dict[str, Callable[[Photo, Strokes], Mattes]] = {
    "contrast": by(GraphCutFoliage()),
    "contrast, lambda 60": by(GraphCutFoliage(smoothness=60.0)),
    "green_red": by(GraphCutFoliage(rule="green_red")),
    "green_red, as printed": by(GraphCutFoliage(rule="green_red", smoothness=60.0, guard=1.0)),
    "GrabCut": grab_cut,
}


def overlap(a: Mask, b: Mask) -> float:
    return float((a & b).sum() / max(1, (a | b).sum()))


def near_score(truth: Mask, found: Mask, within: float = 2.0) -> float:
    """F-score of two thin masks, hits counting within so many px."""
    if not truth.any() or not found.any():
        return 0.0
    to_truth, to_found = (cv2.distanceTransform((~m).astype(np.uint8), cv2.DIST_L2, 5) for m in (truth, found))
    precision, recall = float((to_truth[found] <= within).mean()), float((to_found[truth] <= within).mean())
    return 2 * precision * recall / max(precision + recall, 1e-9)


def wood_in_crown(case: Case, found: Mask) -> tuple[float, float]:
    """Precision against leaf and recall of the wood (H, W) inside the crown's outline."""
    crown = fill_outline(case.strokes.crown, case.photo.size)
    hit = np.count_nonzero(found & case.is_wood & crown)
    leaf, shown = (np.count_nonzero(mask & crown) for mask in (found & case.is_leaf, case.is_wood))
    return hit / max(1, hit + leaf), hit / max(1, shown)


def score(case: Case, rule: Callable[[Photo, Strokes], Mattes]) -> tuple[float, ...]:
    start = perf_counter()
    mattes = rule(case.photo, case.strokes)
    seconds = perf_counter() - start
    rows = np.flatnonzero(case.is_tree.any(axis=1))
    tall = float(np.ptp(rows))
    return (
        overlap(mattes.is_tree, case.is_tree),
        overlap(envelope(mattes.is_tree, tall), envelope(case.is_tree, tall)),
        near_score(case.is_wood, mattes.is_branch),
        seconds,
        *wood_in_crown(case, mattes.is_branch),
    )


RIM = 3  # px on either side of an edge between which colours are compared
REAL_RULES = ("contrast", "green_red, as printed")


def real_photos(shared: Path, wanted: list[str]) -> Iterator[tuple[str, Photo, Strokes]]:
    """(name, photo, strokes) of every tree of the real photographs' manifests."""
    for scene in (load_scene(shared / "photos" / f"{name}.toml") for name in ("street", "woods", "roadside")):
        for tree in scene.trees:
            if tree.name != "pine_back" and (not wanted or any(word in tree.name for word in wanted)):
                yield tree.name, load_photo(tree.views[0].photo), load_strokes(tree.views[0].strokes)


def edge_contrast(photo: Photo, is_tree: Mask) -> float:
    """Median CIEDE2000 between the mean colours just inside and just outside of a mask, along its edge."""
    from skimage.color import deltaE_ciede2000, rgb2lab

    rgb = photo.rgb.astype(np.float32) / np.float32(255)
    tree = is_tree.astype(np.float32)
    size = (2 * RIM + 1, 2 * RIM + 1)
    inside, outside = (
        cv2.blur(rgb * w[..., None], size) / (cv2.blur(w, size) + 1e-6)[..., None] for w in (tree, 1 - tree)
    )
    edge = is_tree & (cv2.erode(tree, np.ones((3, 3))) == 0)
    if not edge.any():
        return 0.0
    return float(np.median(deltaE_ciede2000(rgb2lab(inside[edge]), rgb2lab(outside[edge]))))  # type: ignore[no-untyped-call]


def real_row(photo: Photo, strokes: Strokes) -> list[float]:
    """What can be said of both rules' mattes without a true mask."""
    crown = fill_outline(strokes.crown, photo.size)
    away = cv2.distanceTransform((~crown).astype(np.uint8), cv2.DIST_L2, 5)
    ring = (away > 0) & (away <= dilations_px(10, photo.size))
    for path in strokes.branches:
        ring &= ~draw_polyline(path, photo.size, 4 * dilations_px(10, photo.size))
    found = [RULES[rule](photo, strokes).is_tree for rule in REAL_RULES]
    row = [value for tree in found for value in (tree[crown].mean(), tree[ring].mean(), edge_contrast(photo, tree))]
    return [*map(float, row), overlap(*found)]


def print_real(shared: Path, wanted: list[str]) -> None:
    """The table over the real photographs, in GitHub Markdown."""
    columns = [f"{rule}: {what}" for rule in REAL_RULES for what in ("crown", "ring", "edge")] + ["IoU of the two"]
    rows: list[list[float]] = []
    for name, photo, strokes in real_photos(shared, wanted):
        if not rows:
            print("\n| real photo | " + " | ".join(columns) + " |\n| --- |" + " ---: |" * len(columns))
        rows.append(real_row(photo, strokes))
        print(f"| {name} | " + " | ".join(f"{v:.2f}" for v in rows[-1]) + " |", flush=True)
    if rows:
        print("| **mean** | " + " | ".join(f"{v:.2f}" for v in np.mean(rows, axis=0)) + " |")


def print_truth(shared: Path, wanted: list[str]) -> None:
    """The table over the photos of known truth, then each rule's time beside GrabCut's."""
    total, names_of = [], []
    for case in cases(shared, wanted):
        if not total:
            print(f"{'':24}" + "".join(f"{name:>26}" for name in RULES))
        names_of.append(case.name)
        total.append([score(case, rule) for rule in RULES.values()])
        print(f"{case.name:24}" + "".join(f"{_cells(s):>26}" for s in total[-1]), flush=True)
    if not total:
        return
    mean = np.mean(total, axis=0)
    print(f"{'mean':24}" + "".join(f"{_cells(s):>26}" for s in mean))
    print("\nwood in the crown, contrast: precision, recall")
    for name, row in zip([*names_of, "mean"], [*total, mean], strict=True):
        print(f"{name:24}{row[0][4]:8.2f}{row[0][5]:8.2f}")
    names = list(RULES)
    for name, ratio in zip(names, mean[:, 3] / mean[names.index("GrabCut"), 3], strict=True):
        print(f"{name}: {ratio:.2f} of GrabCut's time")


def main() -> None:
    shared = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2] / "shared"
    wanted = sys.argv[2:]
    if not (shared / "ground_truth").is_dir():
        print("skipped: no folder 'shared' with ground truth beside this checkout")
        return
    print_truth(shared, wanted)
    if (shared / "photos").is_dir():
        print_real(shared, wanted)


def _cells(s: tuple[float, ...] | NDArray[np.float64]) -> str:
    return f"{s[0]:.3f} {s[1]:.3f} {s[2]:.2f} {s[3]:5.1f} s"


if __name__ == "__main__":
    main()
