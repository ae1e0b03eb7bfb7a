"""PrunedSkeleton: noise makes no branch, true branches keep their length, and a person's edits hold."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray
from skimage.morphology import skeletonize

from forestgen.errors import InputError
from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.skeleton import n_children
from forestgen.tree.strokes import SkeletonEdits, Strokes
from forestgen.tree.trace.curve_evolution import Contours, evolve, outlines_of
from forestgen.tree.trace.pruned_skeleton import PrunedSkeleton, edited, pruned_thin
from forestgen.tree.trace.pruned_skeleton_parts import convex, parts_of
from tests.synthetic import drawn_tree

SIZE = (200, 260)
TIPS = [(100, 30), (30, 90), (170, 70)]  # of the letter that is drawn


def fork() -> NDArray[np.bool_]:
    """A trunk 12 px wide with two limbs of 8 px."""
    wood = np.zeros(SIZE[::-1], np.uint8)
    cv2.line(wood, (100, 250), TIPS[0], 1, 12)
    cv2.line(wood, (100, 160), TIPS[1], 1, 8)
    cv2.line(wood, (100, 130), TIPS[2], 1, 8)
    return wood > 0


def with_bumps(wood: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The same with small teeth along its edges: protrusions that look like noise."""
    bumpy = wood.astype(np.uint8)
    for y in range(90, 250, 12):
        cv2.rectangle(bumpy, (106, y), (109, y + 1), 1, -1)
        cv2.rectangle(bumpy, (91, y + 6), (94, y + 7), 1, -1)
    return bumpy > 0


def n_ends(thin: NDArray[np.bool_]) -> int:
    count = cv2.filter2D(thin.astype(np.uint8), cv2.CV_16S, np.ones((3, 3)), borderType=cv2.BORDER_CONSTANT) - 1
    return int((thin & (count == 1)).sum())


def skeleton_of(wood: NDArray[np.bool_], least: float) -> NDArray[np.bool_]:
    contours = outlines_of(wood)
    return pruned_thin(wood, contours, convex(contours, evolve(contours, whole=250.0, least=least)))


def trace(wood: NDArray[np.bool_], tracer: PrunedSkeleton | None = None, **edits: list[list[float]]) -> BranchGraph:
    trunk = np.array([[100.0, 250.0], [100.0, 40.0]])
    crown = np.array([[10.0, 10.0], [190.0, 10.0], [190.0, 200.0], [10.0, 200.0]])
    strokes = Strokes(
        crown, (trunk,), skeleton=SkeletonEdits(**{k: np.array(v, float).reshape(-1, 2) for k, v in edits.items()})
    )
    mattes = Mattes(np.zeros(SIZE[::-1], np.float32), wood.astype(np.float32))
    photo = Photo(np.zeros((*SIZE[::-1], 3), np.uint8), "drawn.png")
    return (tracer or PrunedSkeleton())(photo, strokes, mattes, rng=np.random.default_rng(0))


def tips(graph: BranchGraph) -> NDArray[np.float64]:
    return graph.xy[n_children(graph.parent) == 0]


def test_parts_lie_between_vertices_and_go_on_over_the_seam() -> None:
    contours = Contours(np.random.default_rng(0).random((12, 2)), np.repeat([0, 1, 2], [6, 4, 2]))
    part = parts_of(contours, np.array([1, 4, 7]))
    first, second = part[0], part[1]
    assert_array_equal(part[:6], [first, second, second, second, first, first])
    assert part[6] == part[9] != part[7] == part[8]  # one vertex: cut on the far side too
    assert part[10] == part[11]  # no vertex
    assert len(set(part.tolist())) == 5


def test_noise_makes_no_branch_and_true_branches_stay_whole() -> None:
    bumpy = with_bumps(fork())
    assert n_ends(skeletonize(bumpy)) > 12  # what the paper complains of
    assert 4 <= n_ends(skeleton_of(bumpy, 0.03)) <= 8  # four ends, square ones with two corners each
    row, column = np.nonzero(skeleton_of(bumpy, 0.03))
    for x, y in TIPS:
        assert np.hypot(column - x, row - y).min() <= 2.5  # px
    assert n_ends(skeleton_of(bumpy, 0.001)) > 12  # all vertices relevant: nothing is pruned


def test_what_was_connected_stays_connected() -> None:
    wood = with_bumps(fork())
    wood[150:156, 98:103] = False  # and a hole
    n_holes = cv2.connectedComponents(1 - skeletonize(wood).astype(np.uint8), connectivity=4)[0]
    for least in (0.001, 0.01, 0.1, 10.0):
        thin = skeleton_of(wood, least).astype(np.uint8)
        assert cv2.connectedComponents(thin)[0] == 2  # with the background
        assert cv2.connectedComponents(1 - thin, connectivity=4)[0] == n_holes  # topology stays


def test_a_bumpy_fork_is_a_tree_of_three_tips() -> None:
    graph = trace(with_bumps(fork()))
    found = tips(graph)
    assert len(found) == 3
    for tip in TIPS:
        assert np.hypot(*(found - tip).T).min() < 6  # px
    assert_array_equal(graph.xy[0], [100.0, 250.0])
    assert abs(np.nanmedian(graph.radius_px[:4]) - 6) < 1  # from the distance transform


def test_merged_parts_drop_their_branch() -> None:
    assert len(tips(trace(fork()))) == 3
    contours = outlines_of(fork())
    limb = convex(contours, evolve(contours, whole=220.0, least=0.006))
    near = limb[np.hypot(*(contours.xy[limb] - TIPS[1]).T) < 15]
    graph = trace(fork(), merge=contours.xy[near].tolist())
    assert len(tips(graph)) == 2
    assert np.hypot(*(tips(graph) - TIPS[1]).T).min() > 40


def test_added_vertices_become_tips() -> None:
    wood = fork()
    wood[199:201, 106:110] = True  # too short to count as a branch
    assert len(tips(trace(wood))) == 3
    found = tips(trace(wood, vertices=[[110, 200]]))
    assert len(found) == 4
    assert np.hypot(*(found - [109, 200]).T).min() < 3


@pytest.mark.parametrize(
    ("key", "message"),
    [
        (
            "merge",
            r"strokes: skeleton.merge\[2\]: expected a point within 5 px of a vertex .* came \[150, 240\]; the near",
        ),
        ("vertices", r"strokes: skeleton.vertices\[2\]: expected a point within 5 px of the wood's outline, came"),
    ],
)
def test_points_far_from_the_outline_are_refused(key: str, message: str) -> None:
    contours = outlines_of(fork())
    kept = convex(contours, evolve(contours, whole=220.0, least=0.006))
    edits = SkeletonEdits(**{key: np.array([contours.xy[kept[0]], [150.0, 240.0]])})
    with pytest.raises(InputError, match=message):
        edited(contours, kept, edits, 5.0)
    nothing = outlines_of(np.zeros((5, 5), bool))
    with pytest.raises(InputError, match="move or delete it"):
        edited(nothing, np.empty(0, np.int64), edits, 5.0)


def test_counts_of_vertices() -> None:
    with pytest.raises(ValueError, match="vertices is 2; expected at least 3, or 0"):
        PrunedSkeleton(vertices=2)
    with pytest.raises(ValueError, match="relevance is -1"):
        PrunedSkeleton(relevance=-1)
    assert len(tips(trace(with_bumps(fork()), PrunedSkeleton(vertices=10**6)))) >= 3  # beyond the outline: all stay
    few = trace(fork(), PrunedSkeleton(vertices=3))
    assert 1 <= len(tips(few)) <= 3


def test_wood_in_islands_is_one_tree() -> None:
    tree = drawn_tree(px_per_metre=40.0)
    graph = PrunedSkeleton()(tree.photo, tree.strokes, tree.mattes, rng=np.random.default_rng(0))
    assert len(graph) > 20
    speckled = replace(
        tree.mattes, branch=np.where(np.arange(tree.mattes.branch.shape[1]) % 9 == 0, 0, tree.mattes.branch)
    )
    linked = PrunedSkeleton()(tree.photo, tree.strokes, speckled, rng=np.random.default_rng(0))
    assert (linked.parent[1:] < np.arange(1, len(linked))).all()


def test_a_matte_that_is_all_wood_or_none_gives_the_trunk() -> None:
    everywhere = trace(np.ones(SIZE[::-1], bool))
    assert len(tips(everywhere)) == 1
    nowhere = trace(np.zeros(SIZE[::-1], bool))
    assert len(tips(nowhere)) == 1
    assert np.isnan(nowhere.radius_px).all()  # only the stroke says that there is a trunk
    assert_array_equal(nowhere.xy[0], [100.0, 250.0])
