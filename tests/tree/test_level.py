"""Levels of detail: which is coarser, and a level that reaches nowhere beyond the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.level import EMPTY_MESH, NO_LEAVES, Level, is_coarser, within
from forestgen.tree.model import LeafPrototype, Leaves, Mesh

BOX = np.array([[-1.0, 0.0, -1.0], [1.0, 4.0, 1.0]], np.float32)


def mesh(points: list[list[float]]) -> Mesh:
    n = len(points)
    return Mesh(np.array(points), np.tile([0.0, 0.0, 1.0], (n, 1)), np.zeros((n, 2)), np.array([[0, 1, 2]]))


def level(wood: Mesh = EMPTY_MESH, cards: Mesh = EMPTY_MESH, switch_px: float = 50.0) -> Level:
    return Level(wood, NO_LEAVES, (), cards, switch_px)


def test_wood_and_cards_are_drawn_together_as_one() -> None:
    wood = mesh([[0, -0.1, 0], [0, 2, 0], [0.5, 2, 0]])
    cards = mesh([[-0.5, 1, 0], [0.5, 1, 0.5], [0, 4.1, -0.5]])
    fitted = within(level(wood, cards), BOX)
    assert_allclose(fitted.mesh.points[:, 1], [0, 2, 2], atol=1e-12)  # from -0.1 to 4.1 m: the middle stays
    assert_allclose(fitted.cards.points[2], [0, 4, -0.5], atol=1e-12)
    assert_array_equal(fitted.mesh.points[:, [0, 2]], wood.points[:, [0, 2]])  # nothing sticks out along the others
    stored = np.concatenate([fitted.mesh.points, fitted.cards.points]).astype(np.float32)
    assert (stored >= BOX[0]).all()
    assert (stored <= BOX[1]).all()


def test_a_level_that_fits_stays_as_it_is() -> None:
    inside = mesh([[0, 1, 0], [0.5, 2, 0], [0, 3, 0.5]])
    assert_allclose(within(level(inside), BOX).mesh.points, inside.points, atol=1e-15)
    assert within(level(), BOX).mesh is EMPTY_MESH


def test_leaves_cannot_be_drawn_together() -> None:
    blade = LeafPrototype(
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]),
        np.tile([0.0, 0.0, 1.0], (3, 1)),
        np.zeros((3, 2)),
        np.array([[0, 1, 2]]),
        np.array([0.1, 0.4, 0.1]),
        1.0,
    )
    leaves = Leaves(np.zeros((1, 3)), np.array([[0, 0, 0, 1.0]]), np.ones(1), np.zeros(1, np.int64))
    with pytest.raises(ValueError, match="leaves"):
        within(Level(EMPTY_MESH, leaves, (blade,), EMPTY_MESH, 50.0), BOX)


def test_a_coarser_level_has_fewer_triangles_for_a_smaller_size() -> None:
    fine = level(mesh([[0, 1, 0], [0.5, 2, 0], [0, 3, 0.5]]), switch_px=100.0)
    assert is_coarser(level(switch_px=50.0), fine)
    assert not is_coarser(level(switch_px=100.0), fine)
    assert not is_coarser(replace(fine, switch_px=50.0), fine)
