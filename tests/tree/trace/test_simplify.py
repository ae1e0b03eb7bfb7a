"""Simplifying a traced graph, by hand."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from forestgen.tree.branches import BranchGraph
from forestgen.tree.trace.simplify import simplify, turn

THIRTY = np.deg2rad(30)


def graph_of(xy: list[tuple[float, float]], parent: list[int]) -> BranchGraph:
    return BranchGraph(np.array(xy, float), np.array(parent), np.arange(len(xy), dtype=float))


def test_a_joint_on_a_straight_branch_goes() -> None:
    simple = simplify(graph_of([(0, 9), (0, 6), (0.5, 3), (0, 0)], [-1, 0, 1, 2]), THIRTY)
    assert_allclose(simple.xy, [[0, 9], [0, 0]])
    assert_allclose(simple.parent, [-1, 0])
    assert_allclose(simple.radius_px, [0, 3])


def test_a_joint_that_turns_by_forty_five_degrees_stays() -> None:
    simple = simplify(graph_of([(0, 9), (0, 6), (3, 3)], [-1, 0, 1]), THIRTY)
    assert len(simple) == 3


def test_a_fork_stays_however_straight() -> None:
    #  3 4
    #  | |/
    #  1        0 - 1 is straight on to 3; 4 leaves
    #  0
    simple = simplify(graph_of([(0, 9), (0, 6), (0, 4), (0, 0), (0.5, 0)], [-1, 0, 1, 2, 1]), THIRTY)
    assert_allclose(simple.xy, [[0, 9], [0, 6], [0, 0], [0.5, 0]])
    assert_allclose(simple.parent, [-1, 0, 1, 1])


def test_a_slow_bend_keeps_a_joint_where_its_turns_have_added_up() -> None:
    angle = np.deg2rad(np.arange(0, 91, 10))  # a quarter circle in steps of ten degrees
    arc = graph_of([(float(np.cos(a)), float(np.sin(a))) for a in angle], [-1, *range(9)])
    simple = simplify(arc, THIRTY)
    assert 3 <= len(simple) <= 5
    step = np.diff(simple.xy, axis=0)
    assert max(turn(step[i], step[i + 1]) for i in range(len(step) - 1)) < np.deg2rad(60)


def test_turns() -> None:
    assert_allclose(turn(np.array([1.0, 0]), np.array([0.0, 2])), np.pi / 2)
    assert_allclose(turn(np.array([1.0, 0]), np.array([-3.0, 0])), np.pi)
    assert turn(np.zeros(2), np.array([1.0, 0])) == 0
