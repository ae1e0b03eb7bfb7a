"""Compound leaves: where leaflets stand on a twig's end, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.tree.compound_leaves import palmate, pinnate, points_before
from forestgen.tree.skeleton import Skeleton

#                     4 m    a trunk of 2 m, a level twig of 2 m in four pieces, and one straight up
#   5       2-6-7-8  (x = 2)
#   |     /
#   1----
#   |
#   0
POSITION = np.array(
    [[0, 0, 0], [0, 2, 0], [0.5, 2, 0], [0, 2.5, 0], [0, 3, 0], [0, 4, 0], [1, 2, 0], [1.5, 2, 0], [2, 2, 0]], float
)
TREE = Skeleton(POSITION, np.array([-1, 0, 1, 1, 3, 4, 2, 6, 7]), np.full(9, 0.02))


def test_places_are_measured_back_along_the_twig_but_not_past_its_fork() -> None:
    back = np.array([0.0, 0.25, 0.75, 2.0, 9.0])
    foot, twig, radius = points_before(TREE, np.full(5, 8), back)
    assert_allclose(foot[:, 0], [2, 1.75, 1.25, 0, 0], atol=1e-12)
    assert_allclose(foot[:, 1:], [[2, 0]] * 5, atol=1e-12)
    assert_allclose(twig, [[1, 0, 0]] * 5, atol=1e-12)
    assert_allclose(radius, 0.02)


def test_a_pinnate_leaf_has_pairs_and_an_end() -> None:
    leaf = pinnate(TREE, np.array([8]), 7, 0.9, rng=np.random.default_rng(0))
    assert len(leaf) == 7
    along = 2 - leaf.foot[:, 0]
    assert_allclose(along, [0, 0.3, 0.3, 0.6, 0.6, 0.9, 0.9], atol=1e-9)
    assert leaf.axis[0] @ [1, 0, 0] > 0.9
    left, right = leaf.axis[1::2], leaf.axis[2::2]
    assert (left[:, 2] * right[:, 2] < 0).all()  # one to each side
    assert_allclose(np.abs(leaf.foot[1:, 2]), 0.018, atol=1e-9)  # on the bark
    assert (leaf.face[:, 1] > 0.9).all()
    assert_allclose(np.linalg.norm(leaf.axis, axis=1), 1)


def test_an_even_pinnate_leaf_ends_in_a_pair() -> None:
    leaf = pinnate(TREE, np.array([5, 8]), 4, 0.8, rng=np.random.default_rng(0))
    assert len(leaf) == 8
    assert_allclose(2 - leaf.foot[4:, 0], [0.2, 0.2, 0.6, 0.6], atol=1e-9)


def test_a_palmate_leaf_is_a_fan_at_the_tip() -> None:
    leaf = palmate(TREE, np.array([8]), 5, rng=np.random.default_rng(0))
    assert_allclose(leaf.foot[:, 0], 2, atol=1e-9)
    turn = np.arctan2(leaf.axis[:, 2], leaf.axis[:, 0])
    assert (np.diff(turn) > 0).all() or (np.diff(turn) < 0).all()
    assert np.ptp(turn) == pytest.approx(np.deg2rad(150), abs=0.5)
    assert leaf.share.argmax() == 2
    assert len(palmate(TREE, np.array([8]), 1, rng=np.random.default_rng(0))) == 1
