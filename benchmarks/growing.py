"""How fast a tree grows: python -m benchmarks.growing [--every-frame]

186 steps of a tree of 25,000 nodes, as in table 2 of Kim & Jeong 2014 (24 s computed, 30.7 MB).
Each line: what, processor seconds, the budget, and a ratio against a plain way measured in this run.
The slope is time a node and step at the large size over that at a quarter of it: 1 is linear.
"""

from __future__ import annotations

import resource
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np

from forestgen.growing import grow_tree
from forestgen.pipeline import write_tree
from forestgen.tree.growth import GrowingTree, Growth
from forestgen.tree.growth_binding import bind_mesh
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Leaves, TreeModel
from tests.tree.plain_growth import plain_pose
from tests.tree.skeletons import random_tree
from tests.usd.models import tree_model

NODES, STEPS, LEAVES = 25_000, 186, 90_000


def seconds(work: Callable[[], object], repeats: int = 3) -> float:
    """Processor seconds of the best of a few runs."""
    best = np.inf
    for _ in range(repeats):
        start = process_time()
        work()
        best = min(best, process_time() - start)
    return best


def model(n_nodes: int, n_leaves: int) -> TreeModel:
    """A random tree with leaves on its twigs."""
    rng = np.random.default_rng(1)
    skeleton = random_tree(n_nodes, rng=rng)
    still = tree_model()
    mesh = GeneralisedCylinders()(skeleton, still.bark)
    turn = rng.normal(size=(n_leaves, 4))
    leaves = Leaves(
        position=skeleton.position[rng.integers(20, n_nodes, n_leaves)],
        orientation=turn / np.linalg.norm(turn, axis=1, keepdims=True),
        size=rng.uniform(0.05, 0.1, n_leaves),
        prototype=rng.integers(0, 3, n_leaves),
    )
    return replace(tree_model(leaves=leaves, mesh=mesh), skeleton=skeleton)


def poses(tree: GrowingTree, steps: int) -> None:
    for step in range(1, steps + 1):
        tree.at(step / (steps + 1))


def show(what: str, time: float, note: str = "") -> None:
    print(f"{what:<56}{time:8.3f} s  {note}")


def main() -> None:
    large, quarter = model(NODES, LEAVES), model(NODES // 4, LEAVES // 4)
    tree = Growth()(large.skeleton)
    poses(tree, 2)  # compiled
    steps = seconds(lambda: poses(tree, STEPS))
    few = seconds(lambda: poses(tree, STEPS // 3))
    small = seconds(lambda: poses(Growth()(quarter.skeleton), STEPS))
    show(
        f"{STEPS} skeletons of {NODES:,} nodes",
        steps,
        f"budget 3 s, slope in nodes {steps / small / 4:.2f}, in steps {steps / few / 3:.2f}",
    )
    rest = large.skeleton
    plain = seconds(lambda: plain_pose(rest.position, rest.parent, tree.birth, tree.bend, 0.5, tree.size(0.5)), 1)
    show("one of them in plain Python", plain, f"{plain * STEPS / steps:.0f} x as long")

    points, faces = large.mesh.points, large.mesh.faces
    anchors = bind_mesh(points, faces, rest)
    wood = tree.wood(anchors)
    show(f"{len(points):,} vertices bound", seconds(lambda: bind_mesh(points, faces, rest)))
    show(
        f"{len(points):,} vertices posed {STEPS} times",
        seconds(
            lambda: [tree.carried(anchors, tree.pose(t), tree.thickness(wood, t)) for t in np.linspace(0.01, 1, STEPS)],
            1,
        ),
    )
    with tempfile.TemporaryDirectory() as folder:
        trees = Path(folder) / "trees"
        for name, one in (("large", large), ("quarter", quarter)):
            write_tree(one, name, trees)
        start = process_time()
        made = grow_tree(trees / "large", Growth(), frames=STEPS)
        written = process_time() - start
        show(
            f"grown and written with {made.samples} samples",
            written,
            f"budget 10 s, {made.megabytes:.1f} of 40 MB, error {100 * made.error_share:.2f} % of the height",
        )
        again = seconds(lambda: grow_tree(trees / "quarter", Growth(), frames=STEPS, tolerance=1e-6), 1)
        show("a quarter of it, with as many megabytes", again)
        if "--every-frame" in sys.argv:
            start = process_time()
            made = grow_tree(trees / "large", Growth(), frames=STEPS, every_frame=True)
            show("with a sample for every frame", process_time() - start, f"{made.megabytes:.0f} MB")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"most memory: {peak:.2f} GB  budget 2 GB")


if __name__ == "__main__":
    main()
