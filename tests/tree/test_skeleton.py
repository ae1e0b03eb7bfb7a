"""Skeleton passes, by hand on one small tree."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.branches import BranchGraph
from forestgen.tree.skeleton import (
    Skeleton,
    branch_order,
    height_above_tips,
    is_topological,
    main_child,
    n_children,
    path_length,
)

#   4   5
#    \ /       every edge is as long as its numbers say:
#  3  2        0-1: 2, 1-2: 1, 1-3: 3, 2-4: 1, 2-5: 1 (m)
#   \ |
#     1
#     0
PARENT = np.array([-1, 0, 1, 1, 2, 2])
POSITION = np.array([[0, 0, 0], [0, 2, 0], [0, 3, 0], [-3, 2, 0], [0, 3, 1], [0, 4, 0]], float)


def test_children() -> None:
    assert_array_equal(n_children(PARENT), [1, 2, 2, 0, 0, 0])


def test_path_length_adds_up_from_the_root() -> None:
    assert_allclose(path_length(POSITION, PARENT), [0, 2, 3, 5, 4, 4])


def test_height_above_tips_is_the_longest_way_on() -> None:
    assert_allclose(height_above_tips(POSITION, PARENT), [5, 3, 1, 0, 0, 0])


def test_main_child_is_the_heaviest_and_the_first_of_equals() -> None:
    weight = height_above_tips(POSITION, PARENT)
    assert_array_equal(main_child(weight, PARENT), [1, 2, 4, -1, -1, -1])
    assert_array_equal(main_child(np.array([0.0, 0, 1, 2, 0, 1]), PARENT), [1, 3, 5, -1, -1, -1])


def test_branch_order_counts_departures_from_the_main_branch() -> None:
    assert_array_equal(branch_order(PARENT, np.array([1, 2, 4, -1, -1, -1])), [0, 0, 0, 1, 0, 1])
    assert_array_equal(branch_order(PARENT, np.array([1, 3, 5, -1, -1, -1])), [0, 0, 1, 0, 2, 1])


@pytest.mark.parametrize(
    ("parent", "is_fine"),
    [([-1], True), ([-1, 0, 0, 2], True), ([], False), ([0], False), ([-1, -1], False), ([-1, 2, 0], False),
     ([-1, 1], False), ([-1, 0, -1], False)],
)  # fmt: skip
def test_topological_order(parent: list[int], is_fine: bool) -> None:
    assert bool(is_topological(np.array(parent, np.int64))) is is_fine


def test_skeleton_refuses_what_is_no_tree() -> None:
    with pytest.raises(ValueError, match="only root"):
        Skeleton(POSITION, np.array([-1, 0, 3, 1, 2, 2]), np.ones(6))
    with pytest.raises(ValueError, match="N = 5"):
        Skeleton(POSITION, PARENT, np.ones(5))
    with pytest.raises(ValueError, match="holds NaN"):
        Skeleton(np.full((6, 3), np.nan), PARENT, np.ones(6))
    assert len(Skeleton(POSITION, PARENT, np.full(6, np.nan))) == 6  # a radius may be unknown


def test_branch_graph_refuses_what_is_no_tree() -> None:
    with pytest.raises(ValueError, match="only root"):
        BranchGraph(POSITION[:2, :2], np.array([-1, 1]), np.ones(2))
    assert len(BranchGraph(POSITION[:, :2], PARENT, np.full(6, np.nan))) == 6
