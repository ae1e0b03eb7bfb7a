"""Levels of detail: which is coarser, and a level that reaches nowhere beyond the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from forestgen.tree.level import EMPTY_MESH, NO_LEAVES, Level, is_coarser, within
from forestgen.tree.model import LeafPrototype, Leaves, Mesh

BOX = np.array([[-1.0, 0.0, -1.0], [1.0, 4.0, 1.0]], np.float32)


def mesh(points: list[list[float]]) -> Mesh:
    n = len(points)
    return Mesh(np.array(points), np.tile([0.0, 0.0, 1.0], (n, 1)), np.zeros((n, 2)), np.array([[0, 1, 2]]))


def level(wood: Mesh = EMPTY_MESH, cards: Mesh = EMPTY_MESH, switch_px: float = 50.0) -> Level:
    return Level(wood, NO_LEAVES, (), cards, switch_px)


def test_what_sticks_out_is_drawn_in_and_the_rest_stays() -> None:
    wood = mesh([[0, -0.1, 0], [0, 2, 0], [0.5, 2, 0]])
    cards = mesh([[-0.5, 1, 0], [0.5, 1, 0.5], [0, 4.1, -1.5]])
    fitted = within(level(wood, cards), BOX)
    assert_array_equal(fitted.mesh.points, [[0, 0, 0], [0, 2, 0], [0.5, 2, 0]])
    assert_array_equal(fitted.cards.points, [[-0.5, 1, 0], [0.5, 1, 0.5], [0, 4, -1]])
    assert_array_equal(fitted.mesh.faces, wood.faces)
    assert_array_equal(fitted.cards.faces, cards.faces)


def test_faces_that_lie_beyond_the_box_are_gone() -> None:
    beyond = mesh([[0, 4.1, 0], [0.5, 4.2, 0], [0, 4.3, 0.0]])
    assert len(within(level(cards=beyond), BOX).cards.faces) == 0


def test_a_level_that_fits_stays_as_it_is() -> None:
    inside = mesh([[0, 1, 0], [0.5, 2, 0], [0, 3, 0.5]])
    assert_array_equal(within(level(inside), BOX).mesh.points, inside.points)
    assert len(within(level(), BOX).mesh.points) == 0


def test_leaves_cannot_be_drawn_in() -> None:
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
