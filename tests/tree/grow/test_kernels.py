"""The compiled loops give what their plain versions give."""

from itertools import pairwise

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.grow import kernels
from tests.tree.grow import plain


def test_distance_to_one_segment_by_hand() -> None:
    a, b = np.array([[0.0, 0, 0]]), np.array([[2.0, 0, 0]])
    points = np.array([[1.0, 3, 0], [-3, 4, 0], [5, 0, 4], [2, 0, 0]])
    assert_allclose(kernels.distance_to_segments(points, a, b), [3, 5, 5, 0], atol=1e-12)


def test_a_segment_of_no_length_is_a_point() -> None:
    foot = np.array([[1.0, 1, 1]])
    assert_allclose(kernels.distance_to_segments(np.array([[1.0, 1, 3]]), foot, foot), [2])


def test_distances_are_the_plain_ones() -> None:
    rng = np.random.default_rng(3)
    a, point = rng.normal(size=(70, 3)), rng.normal(size=(200, 3))
    b = a + rng.normal(size=(70, 3)) * 0.3
    assert_allclose(kernels.distance_to_segments(point, a, b), plain.distances(point, a, b), atol=1e-12)


def test_stored_improvements_stay_true_while_the_tree_grows() -> None:
    rng = np.random.default_rng(5)
    target, current = rng.normal(size=(150, 3)), rng.uniform(0.2, 2, 150)
    group = np.repeat(np.arange(20), 6)
    b = np.cumsum(rng.normal(size=(20, 6, 3)) * 0.2, axis=1) + rng.normal(size=(20, 1, 3))
    a = np.concatenate([b[:, :1] - 0.1, b[:, :-1]], axis=1)
    a, b = a.reshape(-1, 3), b.reshape(-1, 3)
    start = np.array([0, 30, 30, 72, 120])  # the second placement was pruned to nothing
    stored = kernels.improvements(a, b, group, start, target, current, 0)
    for _ in range(3):
        want = [np.maximum(current - plain.distances(target, a[s:e], b[s:e]), 0).sum() for s, e in pairwise(start)]
        assert_allclose(kernels.gains(*stored, current), want, atol=1e-10)
        current = current * rng.uniform(0.5, 1, 150)


def test_pruning_is_the_plain_one() -> None:
    rng = np.random.default_rng(7)
    for _ in range(200):
        group = np.repeat(np.arange(5), rng.integers(1, 6, 5))
        first = np.searchsorted(group, np.arange(5))
        parent = np.arange(len(group)) - 1
        for branch, node in enumerate(first):
            parent[node] = -1 if branch == 0 else rng.integers(-1, node)
        length = rng.uniform(0.1, 1, len(group))
        may_pass = rng.random(len(group)) < 0.8
        may_end = may_pass & (rng.random(len(group)) < 0.7)
        case = (parent, group, length, may_pass, may_end, 0.4, 0.3)
        assert_array_equal(kernels.prune(*case), plain.prune(*case))


def test_a_branch_that_leaves_the_crown_is_cut_back_to_where_it_may_end() -> None:
    parent, group = np.array([-1, 0, 1, 2, 1]), np.array([0, 0, 0, 0, 1])
    length = np.ones(5)
    may_pass = np.array([True, True, True, False, True])
    may_end = np.array([True, True, False, False, True])
    stays = kernels.prune(parent, group, length, may_pass, may_end, 0.4, 0.0)
    assert_array_equal(stays, [True, True, False, False, True])
    assert not kernels.prune(parent, group, length, may_pass, may_end, 1.0, 0.0).any()  # whole branches or none


def test_nearest_nodes_by_hand() -> None:
    node, target = np.array([[0.0, 0, 0], [4, 0, 0]]), np.array([[1.0, 0, 0], [3, 1, 0], [9, 0, 0]])
    away2, nearest = np.full(3, np.inf), np.full(3, -1)
    kernels.nearest_nodes(node, 0, target, np.array([True, True, False]), away2, nearest)
    assert_array_equal(nearest, [0, 1, -1])
    assert_allclose(away2, [1, 2, np.inf])
