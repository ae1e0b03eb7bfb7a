"""How fast are leaves? Cutting an atlas, and placing leaves against looking each one up by itself, same crown."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from forestgen.tree.atlas import LeafAtlasFromPhoto
from forestgen.tree.foliage import LeavesAlongBranches
from forestgen.tree.foliage_fit import Placement, blade_samples, footprint, make_target
from forestgen.tree.model import Leaves
from tests.synthetic import drawn_tree
from tests.tree.foliage.crown import rotation, twiggy

PX_PER_METRE = 250.0  # a 1300 x 1550 px photo
PLAIN = 1000  # leaves looked up one by one


def main() -> None:
    tree = drawn_tree(px_per_metre=PX_PER_METRE)
    view, skeleton = tree.view, twiggy(tree.skeleton, per_node=600)
    start = time.process_time()
    atlas = LeafAtlasFromPhoto()([view], rng=np.random.default_rng(0))
    print(f"atlas: {len(atlas.prototypes)} prototypes in {time.process_time() - start:.2f} s")
    for layers in (4.0, 32.0, 64.0, 128.0):  # the slope: seconds grow with leaves
        start = time.process_time()
        leaves = LeavesAlongBranches(layers=layers, spacing=100.0)(
            skeleton, [view], atlas, rng=np.random.default_rng(0)
        )
        spent = time.process_time() - start
        print(f"leaves: {len(leaves):6d} in {spent:.2f} s, {1e6 * spent / len(leaves):5.1f} us each")
    print(f"looking up: {lookup_ratio(leaves, view, skeleton, atlas):.0f} x as fast as leaf by leaf")


def lookup_ratio(leaves: Leaves, view, skeleton, atlas) -> float:  # type: ignore[no-untyped-def]
    """Seconds a leaf, plain over vectorised."""
    target, samples = make_target(view, skeleton), blade_samples(atlas, 64)
    turn = rotation(leaves.orientation)
    start = time.process_time()
    footprint(target, Placement(leaves.position, turn, leaves.size, leaves.prototype), samples)
    fast = (time.process_time() - start) / len(leaves)
    start = time.process_time()
    for k in range(PLAIN):
        points = leaves.position[k] + leaves.size[k] * samples[leaves.prototype[k]] @ turn[k].T
        column, row = np.floor(view.camera.project(points)).astype(int).T
        _ = (target.is_foliage[row, column] | (view.camera.depth(points) < target.wood_depth[row, column])).mean()
    return (time.process_time() - start) / PLAIN / fast


if __name__ == "__main__":
    main()
