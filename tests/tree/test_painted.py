"""Painted foliage: what the strokes make of mattes, and which colours painted leaves take."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.mattes import Mattes
from forestgen.tree.painted import distance, paint, painted_over, tufted
from forestgen.tree.painted_colour import GREEN, dress_painted, lit
from forestgen.tree.strokes import DensityStroke

PATH = np.array([[10.0, 20], [30, 20]])


def half() -> Mattes:
    """A leaf matte whose right half is foliage, and wood all over."""
    foliage = np.zeros((40, 40), np.float32)
    foliage[:, 20:] = 1
    return Mattes(foliage, np.full((40, 40), 0.5, np.float32))


def test_paint_adds_and_removes_in_order() -> None:
    before, rng = half(), np.random.default_rng(0)
    out = paint(before, (DensityStroke(True, 12, PATH), DensityStroke(False, 3, PATH)), rng=rng)
    assert_allclose(out.foliage[20, 12:29], 0, atol=0.01)  # removed last
    assert_allclose(out.foliage[15, 12:18], 1, atol=0.01)  # added beside it
    assert_array_equal(out.foliage[5], before.foliage[5])
    assert paint(before, (), rng=rng) is before
    assert paint(before, (DensityStroke(True, 3, np.array([[8.5, 8.5]])),), rng=rng).foliage[8, 8] == 1


def test_a_brush_ends_in_tufts() -> None:
    stroke = DensityStroke(True, 20, np.array([[40.0, 40], [160, 40]]))
    cover = tufted(stroke, (80, 200), rng=np.random.default_rng(0))
    assert (cover[40, 40:160] == 1).all()  # its middle is whole
    assert not cover[distance(stroke, (80, 200)) > 21].any()  # it reaches no farther than its radius
    rim = (cover[:40, 40:160] < 0.5).sum(axis=0)  # the empty rows above it, a column
    assert rim.min() < 27
    assert rim.max() > rim.min() + 4


def test_painted_foliage_hides_the_wood_behind_it() -> None:
    out = paint(half(), (DensityStroke(True, 4, PATH),), rng=np.random.default_rng(0))
    assert_allclose(out.branch[20, 12:18], 0, atol=0.01)
    assert_allclose(out.branch[5, :20], 0.5)
    assert float((out.foliage + out.branch).max()) <= 1 + 1e-6


def test_where_foliage_was_added_the_photo_is_no_witness() -> None:
    add, remove = DensityStroke(True, 4, PATH), DensityStroke(False, 2, PATH)
    assert painted_over((add, remove), (40, 40))[17:23, 10:30].all()
    assert not painted_over((add, remove), (40, 40))[5, 20]
    assert not painted_over((remove,), (40, 40)).any()


def test_painted_leaves_take_the_colour_of_those_that_the_photo_shows() -> None:
    rgb = np.full((60, 60, 3), (120, 160, 220), np.uint8)  # sky
    share = np.ones((60, 60), np.float32)
    painted, seen = np.zeros((2, 60, 60), bool)
    painted[20:40, 30:50] = True
    seen[20:40, 5:25] = True
    rgb[seen] = (180, 60, 40)
    dress_painted(rgb, share, painted, seen)
    assert_allclose(rgb[painted], [[180, 60, 40]] * 400, atol=1)
    assert_array_equal(rgb[0, 0], (120, 160, 220))
    assert share[30, 40] < 0.1
    assert share[30, 10] == 1


def test_without_a_leaf_in_the_photo_they_are_green_and_lit_from_above() -> None:
    rgb = np.full((60, 60, 3), (120, 160, 220), np.uint8)
    share = np.ones((60, 60), np.float32)
    painted = np.zeros((60, 60), bool)
    painted[10:50, 10:50] = True
    dress_painted(rgb, share, painted, np.zeros_like(painted))
    mean = rgb[painted].mean(axis=0)
    assert_allclose(mean / mean.sum(), np.array(GREEN) / sum(GREEN), atol=0.01)
    light = lit(painted)
    assert light[13:18, 20:40].mean() > light[42:47, 20:40].mean() + 0.2
