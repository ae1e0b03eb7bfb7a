"""Which things share a card: compiled loops against plain ones, and cuts whose answer can be seen."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.render.card_layout import best_cut
from forestgen.render.layout_kernels import best_place, box_around, boxes, placed


def some_boxes(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3, 3) of boxes, along three families' axes; some lie equally far along."""
    rng = np.random.default_rng(n)
    middle = np.round(rng.random((n, 3, 3)), 1)
    half = rng.random((n, 3, 3)) / 20
    return middle - half, middle + half


def test_a_card_is_cut_where_nothing_is():
    # two things on the left, one far to the right
    low = np.array([[0, 0], [1, 1], [10, 0.0]])
    saved, is_first = best_cut(low, low + 1, 0.5)
    assert_array_equal(is_first, [True, True, False])
    assert saved == 11.5 * 2.5 - (2.5 * 2.5 + 1.5 * 1.5)
    assert best_cut(low[:1], low[:1] + 1, 0.5)[0] == 0
    assert best_cut(low[[0, 0]], low[[0, 0]] + 1, 0.5)[0] == 0, "nothing saved where they lie upon each other"


@pytest.mark.parametrize("n", [2, 3, 400])
def test_the_best_place_is_that_of_all_places(n):
    low, high = (corner[:, 0, :2].copy() for corner in some_boxes(n))
    order = np.argsort(low[:, 0] + high[:, 0], kind="stable")

    def area(part: np.ndarray) -> float:
        return float(np.prod(high[part].max(axis=0) - low[part].min(axis=0) + 0.01))

    both = [area(order[:k]) + area(order[k:]) for k in range(1, n)]
    at, parts, whole = best_place(low, high, order, 0.01)
    assert at == int(np.argmin(both))
    assert parts == min(both)
    assert whole == area(order)


def test_boxes_lie_around_corners():
    rng = np.random.default_rng(1)
    points, faces, axes = rng.random((50, 3)), rng.integers(0, 50, (80, 3)), rng.normal(size=(4, 3, 3))
    low, high = np.zeros((80, 4, 3)), np.zeros((80, 4, 3))
    boxes(points, faces, axes, low, high)
    corner = np.einsum("kai,tci->tkca", axes, points[faces])
    assert_allclose(low, corner.min(axis=2), atol=1e-14)
    assert_allclose(high, corner.max(axis=2), atol=1e-14)
    member = np.array([3, 70, 21])
    box = box_around(low, high, member, 2)
    assert_array_equal(box, [low[member, 2].min(axis=0), high[member, 2].max(axis=0)])


def test_corners_are_placed_in_their_cards_frames():
    rng = np.random.default_rng(2)
    corner, frame, card = rng.random((60, 3, 3)), rng.normal(size=(5, 4, 4)), rng.integers(0, 5, 60)
    mine = frame[card]
    wanted = np.einsum("tai,tci->tca", mine[:, :3, :3], corner) + mine[:, None, :3, 3]
    assert_allclose(placed(corner, frame, card), wanted, atol=1e-13)
