"""How even is a crown all round, of which one photo shows one side?

    python benchmarks/crowns.py [--method tan2008] [--set truth|photos] [--only NAME] [--seeds 1]

Builds trees from the folder `shared` beside the checkout and prints a table. The foliage is counted in
cubes about the trunk, in 8 bands of height and 12 sectors of azimuth:

- `emptiest`: the emptiest sector of a band over the band's mean, mean over the bands by what they hold;
- `depth`: what stands before and behind the trunk, 30 degrees to either side of the line of sight, over
  what stands as near to the picture's plane on both sides of it: 1 for a tree that was not made from a photo;
- `bare`: share of the side branches' length, above the lowest leaves, that has no leaf near.

Trees of known truth stand beside their own true branches, whose last generation bears the leaves.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from fidelity import SHARED, column_means, markdown, photo_scenes, truth_scene
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.camera import Camera
from forestgen.pipeline import build_model
from forestgen.scene.manifest import TreeSpec
from forestgen.tree.model import TreeModel
from forestgen.tree.skeleton import Skeleton, branch_order, height_above_tips, main_child

BANDS, SECTORS = 8, 12
CUBE = 0.03  # of the height: edge of the cubes that foliage is counted in, and how near a leaf is near
ENDS = 0.01  # of the leaves at the crown's foot and top make no band longer
ALONG, ACROSS = (2, 3, 8, 9), (0, 5, 6, 11)  # sectors about the line of sight and about the picture's plane
SPREAD = 0.02  # of the height: how far the leaves of a true branch stand from it
PIECE = 0.005  # of the height: between places along a true branch


def foliage_counts(points: NDArray[np.float64], trunk: NDArray[np.float64], height: float) -> NDArray[np.float64]:
    """Cubes (BANDS, SECTORS) that hold some of the points (N, 3), about a trunk (P, 3), in a camera's axes.

    Azimuth 0 is on the right, a quarter turn is toward the camera.
    """
    rising = trunk[np.argsort(trunk[:, 1], kind="stable")]
    axis = [np.interp(points[:, 1], rising[:, 1], rising[:, k]) for k in (0, 2)]
    local = points - np.column_stack([axis[0], np.zeros(len(points)), axis[1]])
    low, high = np.quantile(local[:, 1], [ENDS, 1 - ENDS])
    middle = (np.unique(np.floor(local / (CUBE * height)), axis=0) + 0.5) * CUBE * height
    band = np.clip((middle[:, 1] - low) / max(high - low, 1e-9) * BANDS, 0, BANDS - 1).astype(int)
    sector = np.floor(np.arctan2(middle[:, 2], middle[:, 0]) / (2 * np.pi) * SECTORS).astype(int) % SECTORS
    counts = np.zeros((BANDS, SECTORS))
    np.add.at(counts, (band, sector), 1)
    return counts


def emptiest(counts: NDArray[np.float64]) -> float:
    """Of counts (BANDS, SECTORS), the emptiest sector's share of the mean: 1 is even all round, 0 has a gap."""
    return float(counts.min(axis=1).sum() / counts.mean(axis=1).sum())


def depth(counts: NDArray[np.float64]) -> float:
    """Foliage before and behind the trunk over that on both sides of it."""
    return float(counts[:, ALONG].sum() / max(counts[:, ACROSS].sum(), 1.0))


def bare_share(skeleton: Skeleton, leaves: NDArray[np.float64], height: float) -> float:
    """Share of the side branches' length that has none of the leaves (L, 3) near, above the lowest of them."""
    position, parent = skeleton.position, skeleton.parent
    order = branch_order(parent, main_child(height_above_tips(position, parent), parent))
    node = np.flatnonzero((order > 0) & (position[:, 1] > np.quantile(leaves[:, 1], ENDS)))
    start, end = position[parent[node]], position[node]
    length = np.linalg.norm(end - start, axis=1)
    away, _ = cKDTree(leaves).query((start + end) / 2)
    return float(length[away > CUBE * height].sum() / max(float(length.sum()), 1e-9))


def trunk_of(skeleton: Skeleton) -> NDArray[np.float64]:
    """Nodes (P, 3) of the longest way up from the root."""
    child = main_child(height_above_tips(skeleton.position, skeleton.parent), skeleton.parent)
    nodes = [0]
    while child[nodes[-1]] >= 0:
        nodes.append(int(child[nodes[-1]]))
    return skeleton.position[nodes]


def measures(model: TreeModel) -> list[float | None]:
    """Emptiest sector, depth and bare share of a built tree; none for a tree without leaves."""
    leaves, camera = model.leaves.position, model.views[0].camera
    if not len(leaves):
        return [None, None, None]
    counts = foliage_counts(in_axes(leaves, camera), in_axes(trunk_of(model.skeleton), camera), model.height)
    return [emptiest(counts), depth(counts), bare_share(model.skeleton, leaves, model.height)]


def in_axes(points: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    return np.asarray(points @ camera.axes.T)


def true_measures(folder: Path, *, rng: np.random.Generator) -> list[float | None]:
    """Emptiest sector and depth of a true tree (`skeleton.json`); none where it is not known, or bare."""
    if not (folder / "skeleton.json").is_file() or folder.name.endswith("winter"):
        return [None, None]
    branches = json.loads((folder / "skeleton.json").read_text())["branches"]
    height = float(json.loads((folder / "truth.json").read_text())["height_m"])
    last = max(branch["level"] for branch in branches)
    points = np.concatenate([_densely(b["xyz"], PIECE * height) for b in branches if b["level"] == last])
    trunk = np.array(next(branch for branch in branches if branch["level"] == 0)["xyz"])
    counts = foliage_counts(points + rng.normal(0, SPREAD * height, points.shape), trunk, height)
    return [emptiest(counts), depth(counts)]


def _densely(line: Sequence[Sequence[float]], step: float) -> NDArray[np.float64]:
    """Places (N, 3) along a polyline, about `step` metres apart."""
    xyz = np.asarray(line, float)
    way = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(xyz, axis=0), axis=1))])
    at = np.linspace(0, way[-1], 2 + int(way[-1] / step))
    return np.column_stack([np.interp(at, way, xyz[:, k]) for k in range(3)])


def row_of(tree: TreeSpec, seeds: int) -> list[str | float | None]:
    """One row of the table: means over as many seeds, from the tree's own on, and the truth."""
    built = [measures(build_model(replace(tree, seed=tree.seed + 1000 * k))) for k in range(seeds)]
    truth = true_measures(SHARED / "ground_truth" / tree.name, rng=np.random.default_rng(0))
    return [
        tree.name,
        *(None if None in column else float(np.mean(column)) for column in zip(*built, strict=True)),
        *truth,
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--method", default="tan2008")
    parser.add_argument("--set", choices=("truth", "photos"), help="default: both")
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="a tree; may be repeated")
    parser.add_argument("--seeds", type=int, default=1, help="trees grown of each photo, for a mean")
    options = parser.parse_args()
    if not (SHARED / "ground_truth").is_dir():
        print(f"skipped: there is no folder '{SHARED.name}' with photographs and ground truth beside this checkout")
        return
    truth = truth_scene(SHARED, options.method, options.only) if options.set != "photos" else None
    scenes = photo_scenes(SHARED, options.method, options.only) if options.set != "truth" else []
    rows = [row_of(tree, options.seeds) for scene in ([truth] if truth else []) + scenes for tree in scene.trees]
    head = ["tree", "emptiest sector", "depth", "bare", "true emptiest sector", "true depth"]
    print(markdown(head, [*rows, ["**mean**", *column_means(rows)]]))


if __name__ == "__main__":
    main()
