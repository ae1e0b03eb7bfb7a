"""The compiled searches for the nearest wood find what plain ones find."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from forestgen.tree.growth_kernels import nearest_piece, nearest_way
from tests.tree.skeletons import random_tree


def off(points: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Squared distances (P,) of points (P, 3) from a segment, and the places along it (P,)."""
    chord = b - a
    square = float(chord @ chord)
    t = np.clip((points - a) @ chord / square, 0, 1) if square else np.zeros(len(points))
    return ((points - a - t[:, None] * chord) ** 2).sum(axis=1), t


def test_the_nearest_way_is_the_one_of_least_squares() -> None:
    rng = np.random.default_rng(4)
    tree = random_tree(150, rng=rng)
    candidate = rng.integers(0, 150, (40, 6))
    probe = tree.position[rng.integers(0, 150, (40, 5))] + rng.normal(0, 0.1, (40, 5, 3))
    sums = np.zeros((40, 6))
    for row, of_row in enumerate(candidate.tolist()):
        for k, node in enumerate(of_row):
            each = [off(probe[row], tree.position[node], tree.position[node])[0]]
            while tree.parent[node] >= 0:
                each.append(off(probe[row], tree.position[tree.parent[node]], tree.position[node])[0])
                node = tree.parent[node]
            sums[row, k] = np.min(each, axis=0).sum()
    found = nearest_way(tree.position, tree.parent, candidate, probe)
    assert_allclose(sums[np.arange(40), found], sums.min(axis=1), rtol=1e-12)
    assert len(np.unique(found)) == 6


def test_of_equal_ways_the_first_counts() -> None:
    tree = random_tree(60, rng=np.random.default_rng(4))
    same = np.array([[30, 30, 30], [7, 40, 7]])
    found = nearest_way(tree.position, tree.parent, same, tree.position[[[30], [7]]])
    assert_array_equal(found, [0, 0])


def test_the_nearest_piece_is_the_nearest_of_those_asked_for() -> None:
    rng = np.random.default_rng(6)
    tree = random_tree(150, rng=rng)
    candidate = rng.integers(0, 150, (80, 4))
    points = tree.position[candidate[:, 0]] + rng.normal(0, 0.3, (80, 3))
    node, part = nearest_piece(tree.position, tree.parent, candidate, points)
    for v in range(80):
        ends = tree.position[np.maximum(tree.parent[candidate[v]], 0)]
        each = [off(points[v : v + 1], a, tree.position[i]) for a, i in zip(ends, candidate[v], strict=True)]
        best = int(np.argmin([distance[0] for distance, _ in each]))
        assert node[v] == candidate[v, best]
        assert_allclose(part[v], each[best][1][0], atol=1e-12)
