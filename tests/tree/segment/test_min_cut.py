"""The graph cut against all labellings of a tiny grid, and the smoothness costs by hand."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.segment.min_cut import min_cut
from forestgen.tree.segment.smoothness import edge_costs


@pytest.mark.parametrize("seed", range(5))
def test_no_labelling_is_cheaper(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, zero = rng.random((2, 3, 3))
    right, down = 0.6 * rng.random((2, 3, 3))

    def energy(label: np.ndarray) -> float:
        data = np.where(label, one, zero).sum()
        return float(
            data
            + (right[:, :-1] * (label[:, 1:] != label[:, :-1])).sum()
            + (down[:-1] * (label[1:] != label[:-1])).sum()
        )

    least = min(energy(np.array(bits, bool).reshape(3, 3)) for bits in product([False, True], repeat=9))
    assert energy(min_cut(one, zero, right, down)) == pytest.approx(least)


def test_label_one_where_one_is_cheap() -> None:
    one = np.array([[0.0, 5.0, 0.0]])
    none = np.zeros((1, 3))
    assert_array_equal(min_cut(one, 5 - one, none, none), [[True, False, True]])
    strong = np.full((1, 3), 4.0)  # two edges of 4 cost more than one wrong pixel of 5
    assert_array_equal(min_cut(one, 5 - one, strong, none), [[True, True, True]])
    assert min_cut(np.empty((0, 4)), np.empty((0, 4)), np.empty((0, 4)), np.empty((0, 4))).shape == (0, 4)


def test_edges_cost_lambda_over_the_difference() -> None:
    # 0 and 30 levels of red: distance 30; equal colours count as the guard; the last column has no right neighbour
    rgb = np.zeros((2, 2, 3), np.float32)
    rgb[0, 1, 0] = 30 / 255
    right, down = edge_costs(rgb, 60.0, 2.0)
    assert_allclose(right, [[2, 0], [30, 0]], rtol=1e-5)
    assert_allclose(down, [[30, 2], [0, 0]], rtol=1e-5)
