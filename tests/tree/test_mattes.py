"""Mattes and View: two alphas that lie over one photo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from forestgen.tree.mattes import Mattes
from tests.synthetic import drawn_tree


def test_half_covered_counts() -> None:
    mattes = Mattes(np.array([[0.5, 0.49, 0]]), np.array([[0, 0.5, 0.2]]))
    assert mattes.foliage.dtype == np.float32
    assert_array_equal(mattes.is_foliage, [[True, False, False]])
    assert_array_equal(mattes.is_branch, [[False, True, False]])
    assert_array_equal(mattes.is_tree, [[True, True, False]])
    assert not mattes.is_bare


def test_a_tree_without_a_leaf_pixel_is_bare() -> None:
    assert Mattes(np.full((2, 2), 0.4), np.ones((2, 2))).is_bare


@pytest.mark.parametrize("wrong", [-0.1, 1.1, np.nan])
def test_alpha_lies_between_0_and_1(wrong: float) -> None:
    with pytest.raises(ValueError, match=r"Mattes.branch must lie in \[0, 1\]"):
        Mattes(np.zeros((1, 2)), np.array([[0, wrong]]))


def test_mattes_agree_in_size() -> None:
    with pytest.raises(ValueError, match="H = 2"):
        Mattes(np.zeros((3, 2)), np.zeros((2, 2)))


def test_view_wants_one_size() -> None:
    view = drawn_tree(px_per_metre=20).view
    with pytest.raises(ValueError, match="differ in size"):
        replace(view, mattes=Mattes(np.zeros((3, 2)), np.zeros((3, 2))))
    with pytest.raises(ValueError, match="differ in size"):
        replace(view, camera=replace(view.camera, size=(5, 5)))
