"""Tracing and smoothing: who joins whom, by hand and against the plain kernel; loops are laid straight."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.lift.flow_kernels import enter_cells, meet_traces
from forestgen.tree.lift.flow_smoothing import (
    joined_forward,
    smoothed,
    straightened,
    thinned,
    tips_beyond,
    without_stubs,
)
from forestgen.tree.lift.flow_tracing import Graph, joined_pairs, nearest_neighbour
from tests.tree.lift import plain_flow


def test_meeting_traces_equals_the_plain_way() -> None:
    rng = np.random.default_rng(3)
    n, steps, near = 60, 8, 0.12
    ways = rng.random((n, 1, 3)) + np.cumsum(rng.normal(0, 0.03, (n, steps, 3)) - [0, 0.05, 0], axis=1)
    node = ways.reshape(-1, 3).copy()
    onward = np.where(np.arange(n * steps) % steps == steps - 1, -1, np.arange(n * steps) + 1)
    of, name = np.repeat(np.arange(n), steps), np.arange(n)
    tip = np.arange(n) * steps + steps - 1
    x, v = node[tip].copy(), rng.normal(0, 0.05, (n, 3)) - [0, 0.05, 0]
    low, shape = node.min(axis=0) - near, np.full(3, 30)
    head, following, group = np.full(27_000, -1), np.full(len(node), -1), np.arange(n)
    enter_cells(node, 0, len(node), head, following, low, near, shape)
    plain_onward, plain_group = onward.tolist(), group.tolist()
    expected = plain_flow.meet_traces(
        x, v, name.tolist(), node, plain_onward, of.tolist(), plain_group, tip.tolist(), near, 0.3
    )
    done = meet_traces(x, v, name, tip, node, onward, of, group, head, following, low, near, shape, near, 0.3)
    assert 5 < done.sum() < n
    assert_array_equal(done, expected)
    assert_array_equal(onward, plain_onward)


def test_the_nearest_other_point() -> None:
    which, gap = nearest_neighbour(np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 0], [5, 0, 0]]))
    assert_array_equal(which[1:3], [2, 1])
    assert_allclose(gap, [1, 0, 0, 4])
    which, gap = nearest_neighbour(np.zeros((1, 3)))
    assert_array_equal(which, [0])
    assert np.isinf(gap[0])


def test_only_mutual_neighbours_that_are_near_and_still_moving_join() -> None:
    x = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.25, 0, 0], [5, 0, 0], [5.1, 0, 0], [9, 0, 0], [9.5, 0, 0]])
    lost = np.array([False, False, False, True, False, False, False])
    keep, into = joined_pairs(x, lost, 0.2)
    assert_array_equal(keep, [0])
    assert_array_equal(into, [1])


#        4 - 5      a way along 0 1 2 3 6 7, with a loop at 4 5 and a stub 8 at node 1
LOOP = Graph(
    np.array([[0, 0, 0], [0, 1, 0], [0, 2, 0], [0.1, 2.3, 0], [0.9, 2.4, 0], [0.9, 2.6, 0], [0.1, 2.7, 0], [0, 3, 0],
              [0.1, 1.05, 0], [0, 4, 0]], float),
    np.array([-1, 0, 1, 2, 3, 4, 5, 6, 1, 7]),
    np.array([0, -1, -1, -1, -1, -1, -1, -1, -1, -1]),
)  # fmt: skip


def test_a_loop_is_laid_straight_and_ends_stay() -> None:
    graph = straightened(LOOP, 3.0)
    assert_allclose(graph.position[[0, 1, 7, 8, 9]], LOOP.position[[0, 1, 7, 8, 9]])
    assert np.abs(graph.position[3:7, 0]).max() < 0.11
    assert_array_equal(graph.parent, LOOP.parent)


def test_a_straight_way_is_left_alone() -> None:
    graph = Graph(np.column_stack([np.zeros(9), np.arange(9.0), np.zeros(9)]), np.arange(-1, 8), np.full(9, -1))
    assert_array_equal(straightened(graph, 5.0).position, graph.position)


def test_stubs_fall_and_long_branches_and_limbs_stay() -> None:
    graph = without_stubs(LOOP, 0.5)
    assert len(graph.parent) == len(LOOP.parent) - 1
    assert tips_beyond(graph.parent)[0] == 1
    limb = Graph(LOOP.position, LOOP.parent, np.arange(10))
    assert len(without_stubs(limb, 0.5).parent) == 10


def test_smoothing_keeps_tips_limbs_and_the_middle_of_a_line() -> None:
    graph = smoothed(LOOP, 50)
    assert_array_equal(graph.position[[0, 8, 9]], LOOP.position[[0, 8, 9]])
    assert graph.position[4, 0] < 0.5
    fixed = Graph(LOOP.position, LOOP.parent, np.arange(10))
    assert_array_equal(smoothed(fixed, 50).position, LOOP.position)


def test_thinning_keeps_forks_tips_and_ways() -> None:
    graph = thinned(LOOP, 1.5)
    assert 4 <= len(graph.parent) < 10
    for place in LOOP.position[[0, 1, 8, 9]]:
        assert (np.linalg.norm(graph.position - place, axis=1) < 1e-12).any()


def test_a_branch_that_bends_back_leaves_further_down() -> None:
    position = np.array([[0, 0, 0], [0, 1, 0], [0, 2, 0], [0, 3, 0], [0, 4, 0], [1, 1.5, 0]], float)
    graph = joined_forward(Graph(position, np.array([-1, 0, 1, 2, 3, 3]), np.full(6, -1)), 5.0)
    assert graph.parent[5] == 1  # from node 3 and 2 it would run back down
    assert joined_forward(Graph(position, np.array([-1, 0, 1, 2, 3, 3]), np.full(6, -1)), 0.0).parent[5] in (2, 3)
