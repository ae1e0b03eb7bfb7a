"""Spreading branches in depth: the photo stays as it was, and the tree is round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.errors import StageError
from forestgen.tree.branch_paths import cut_into_paths
from forestgen.tree.branches import BranchGraph
from forestgen.tree.lift.spread_branches import SpreadBranches, sideways_length
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View
from tests.synthetic import drawn_tree

VIEW = drawn_tree(leaves=False).view


def lift(view: View, seed: int = 0, **settings: float) -> Skeleton:
    return SpreadBranches(**settings)([view], rng=np.random.default_rng(seed))  # type: ignore[arg-type]


@pytest.mark.parametrize("azimuth", [0.0, 1.2])
@pytest.mark.parametrize("focal_px", [None, 900.0])
def test_the_lifted_skeleton_projects_onto_what_was_traced(azimuth: float, focal_px: float | None) -> None:
    view = replace(VIEW, camera=replace(VIEW.camera, azimuth=azimuth, focal_px=focal_px))
    skeleton = lift(view)
    assert_allclose(view.camera.project(skeleton.position), view.branches.xy, atol=1e-9)
    assert_allclose(skeleton.radius, view.branches.radius_px / view.camera.px_per_metre)
    assert_allclose(skeleton.position[0], 0, atol=1e-12)


def test_two_views_are_refused() -> None:
    with pytest.raises(StageError, match="one photo of a tree and came 2"):
        SpreadBranches()([VIEW, VIEW], rng=np.random.default_rng(0))


def test_the_trunk_stays_in_the_photos_plane_and_branches_leave_it_to_both_sides() -> None:
    skeleton = lift(VIEW)
    paths = cut_into_paths(VIEW.branches.xy, VIEW.branches.parent, 9.0)
    depth = skeleton.position[:, 2]
    assert_allclose(depth[paths.nodes[0]], 0, atol=1e-12)
    tips = np.array([depth[nodes[-1]] for nodes in paths.nodes[1:]])
    assert tips.max() > 0.1
    assert tips.min() < -0.1


def test_depth_has_no_kink_along_a_branch() -> None:
    graph, skeleton = VIEW.branches, lift(VIEW)
    paths = cut_into_paths(graph.xy, graph.parent, 9.0)
    flat = graph.xy * [1, -1]
    for branch in range(1, len(paths)):
        nodes, base = paths.nodes[branch], int(paths.base[branch])
        gain = sideways_length(flat, nodes, base, paths.axis[branch] * [1, -1], 0.35)
        slope = (skeleton.position[nodes, 2] - skeleton.position[base, 2]) / gain
        assert_allclose(slope, slope[0], rtol=1e-3)  # the parent's direction is seen over another length here


def test_no_branch_shoots_at_the_camera() -> None:
    graph, skeleton = VIEW.branches, lift(VIEW)
    step = skeleton.position[1:] - skeleton.position[graph.parent[1:]]
    assert (np.abs(step[:, 2]) <= np.tan(np.deg2rad(60)) * np.hypot(step[:, 0], step[:, 1]) + 1e-9).all()


def test_two_branches_drawn_one_above_the_other_part_in_depth() -> None:
    #        7
    #  4 5   6     both lower branches go left, a hand's breadth apart
    #   \ \  |
    #    \ 3-2     (3 leaves at 2, 4 leaves at 1)
    #     `--1
    #        0
    xy = np.array([[50, 100], [50, 60], [50, 54], [30, 44], [28, 50], [22, 40], [50, 30], [50, 5]], float)
    parent = np.array([-1, 0, 1, 2, 1, 3, 2, 6])
    view = replace(VIEW, branches=BranchGraph(xy, parent, np.full(8, 1.0)))
    skeleton = lift(view)
    lower, upper = skeleton.position[4, 2], skeleton.position[5, 2]
    assert abs(upper - lower) > 0.1


def test_same_seed_same_skeleton() -> None:
    assert lift(VIEW, 3).position.tobytes() == lift(VIEW, 3).position.tobytes()


def test_a_lone_stroke_is_a_flat_trunk() -> None:
    view = replace(VIEW, branches=BranchGraph(np.array([[50.0, 90], [52, 50], [50, 10]]), [-1, 0, 1], [3, 2, np.nan]))  # type: ignore[arg-type]
    assert_allclose(lift(view).position[:, 2], 0)


def test_way_along_the_parent_counts_only_in_part() -> None:
    flat = np.array([[0.0, 0], [1, 0], [1, 2]])
    gain = sideways_length(flat, np.array([1, 2]), 0, np.array([0.0, 1.0]), 0.25)
    assert_allclose(gain, [1, 1.5])
