"""Closed masks: narrow gaps are gone, wide ones and outlines stay."""

import numpy as np
from numpy.testing import assert_array_equal

from forestgen.tree.closing import close, dilate


def test_closing_fills_gaps_narrower_than_the_disc_and_no_others() -> None:
    mask = np.ones((60, 60), bool)
    mask[:, 20:25] = False
    mask[:, 40:52] = False
    closed = close(mask, 4)
    assert closed[30, 20:25].all()
    assert not closed[30, 42:50].any()
    assert not close(mask, 1)[:, 21:24].any()


def test_closing_leaves_outlines_at_the_edge_of_the_picture_too() -> None:
    mask = np.zeros((40, 60), bool)
    mask[10:30, :20] = mask[10:30, 24:45] = True  # a gap of 4 px, and the photo's edge
    closed = close(mask, 4.0)
    assert closed[15:25, 20:24].all()
    assert_array_equal(closed[:, :20], mask[:, :20])
    assert not closed[:, 45:].any()
    assert (closed | ~mask).all()


def test_a_pixel_grows_to_a_disc() -> None:
    mask = np.zeros((41, 41), bool)
    assert not dilate(mask, 5).any()
    mask[20, 20] = True
    row, column = np.mgrid[-20:21, -20:21]
    assert_array_equal(dilate(mask, 6.5), np.hypot(row, column) <= 6.5)
