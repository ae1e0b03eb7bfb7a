"""How fast is growth? The engine with stored gains against the plain one that measures afresh, same tree."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from forestgen.arrays import stage_rng
from forestgen.camera import Camera
from forestgen.tree.grow.attractors import empty_field, image_attractors, picture_plane
from forestgen.tree.grow.crown_volume import crown_volume
from forestgen.tree.grow.growing_tree import GrowingTree
from forestgen.tree.grow.limbs import LimbRules, add_turned_joints, grow_limbs
from forestgen.tree.grow.scores import PlacementRules, Scores
from forestgen.tree.grow.subtree_library import PREDEFINED, load_subtrees
from forestgen.tree.grow.subtree_replacement import SubtreeReplacement
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.strokes import Strokes
from forestgen.tree.view import View
from tests.tree.grow.crowns import ball_view, two_limbs
from tests.tree.grow.plain import PlainScores

SCALE = 5  # the tests' drawn photo, enlarged to 1500 x 1700 px
ITERATIONS = 100
PLAIN_ITERATIONS = 10


def large_view() -> View:
    small = ball_view()
    grown = [np.kron(m, np.ones((SCALE, SCALE), np.float32)) for m in (small.mattes.foliage, small.mattes.branch)]
    camera = Camera(
        (small.camera.size[0] * SCALE, small.camera.size[1] * SCALE),
        (small.camera.root_px[0] * SCALE, small.camera.root_px[1] * SCALE),
        small.camera.px_per_metre * SCALE,
    )
    strokes = Strokes(small.strokes.crown * SCALE, tuple(b * SCALE for b in small.strokes.branches))
    photo = Photo(np.zeros((camera.size[1], camera.size[0], 3), np.uint8), "drawn.png")
    return View(photo, strokes, Mattes(grown[0], grown[1]), small.branches, camera)


def grow(view: View, kind: type, iterations: int) -> tuple[GrowingTree, float, int]:
    """The limbs of a ball of leaves, the seconds that the iterations took, and the bytes stored."""
    volume = crown_volume([view])
    tree = GrowingTree(two_limbs())
    library = tuple(s for s in load_subtrees(PREDEFINED) if s.form == "decurrent")
    ends = tree.segments()
    image, space = empty_field(), empty_field()
    image.add(image_attractors(volume.leafy[0], view.camera, 0.25), *[picture_plane(view.camera, e) for e in ends])
    add_turned_joints(tree, space, 0)
    space.add(volume.sample(0.5, stage_rng(0, "volume")), *ends)
    scores = kind(PlacementRules(library, 12, volume, 0.4, 0.4), [image], space)
    begin = time.perf_counter()
    grow_limbs(tree, scores, LimbRules(iterations, 6, 0.2, 0.0, 0), rng=stage_rng(0, "grow"), on_step=None)
    return tree, time.perf_counter() - begin, getattr(scores, "n_bytes", 0)


def main() -> None:
    view = large_view()
    grow(view, Scores, 2)  # compiles, or reads the compiled code
    fast, seconds, _ = grow(view, Scores, PLAIN_ITERATIONS)
    plain, plain_seconds, _ = grow(view, PlainScores, PLAIN_ITERATIONS)
    assert np.array_equal(fast.parent, plain.parent), "the two engines must grow the same tree"
    print(f"{PLAIN_ITERATIONS} iterations, 1500 px: {seconds:.2f} s; plain {plain_seconds:.2f} s:", end=" ")
    print(f"{plain_seconds / seconds:.0f} x as fast, same tree")
    _, seconds, stored = grow(view, Scores, ITERATIONS)
    print(f"{ITERATIONS} iterations: {seconds:.2f} s (budget 1 s), {stored / 1e6:.1f} MB of placements stored")
    for name, strategy in (
        ("limbs and twigs, default", SubtreeReplacement()),
        ("the paper's setting", SubtreeReplacement.paper()),
    ):
        begin = time.perf_counter()
        tree = strategy(two_limbs(), [view], rng=stage_rng(0, "grow"))
        print(f"{name}: {time.perf_counter() - begin:.2f} s, {len(tree)} nodes")


if __name__ == "__main__":
    main()
