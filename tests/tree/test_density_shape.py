"""The rounded shape of a crown: what its parts measure, and that both outlines stay whole."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.camera import Camera
from forestgen.tree.density_shape import across_weights, close, is_one_sided, membrane, row_ellipses, row_share
from tests.tree.solids import camera


def test_a_membrane_over_a_disc_is_the_square_of_a_balls_half_thickness() -> None:
    row, column = np.mgrid[:81, :81] - 40
    squared = row**2 + column**2
    disc = squared <= 38.5**2
    assert_allclose(membrane(disc)[disc], (39**2 - squared)[disc], atol=0.04 * 39**2)
    assert not membrane(disc)[~disc].any()


def test_a_row_of_an_ellipse_falls_from_its_middle_to_its_ends() -> None:
    inside = np.array([[0, 1, 1, 1, 1, 0], [0, 0, 0, 0, 0, 0], [0, 1, 0, 1, 0, 0]], bool)
    wide = [0, 7 / 16, 15 / 16, 15 / 16, 7 / 16, 0]
    assert_allclose(row_ellipses(inside), [wide, [0] * 6, [0, 5 / 9, 0, 5 / 9, 0, 0]])


def test_shares_of_an_empty_row_are_nothing() -> None:
    assert_allclose(row_share(np.array([[1.0, 4.0], [0.0, 0.0]])), [[0.25, 1], [0, 0]])


def test_closing_fills_gaps_narrower_than_the_disc_and_leaves_outlines() -> None:
    mask = np.zeros((40, 60), bool)
    mask[10:30, :20] = mask[10:30, 24:45] = True  # a gap of 4 px, and the photo's edge
    closed = close(mask, 4.0)
    assert closed[15:25, 20:24].all()
    assert_allclose(closed[:, :20], mask[:, :20])
    assert not closed[:, 45:].any()
    assert not close(mask, 1.0)[:, 20:24].any()


def radius_measured(cameras: list[Camera], azimuth: float) -> float:
    """The radius that weighted squared offsets give a point at 1 m from the trunk."""
    point = np.array([[np.cos(azimuth), 0.0, np.sin(azimuth)]])
    across = np.array([(point @ c.axes[0])[0] for c in cameras])
    return float(across_weights(cameras) @ across**2)


@pytest.mark.parametrize("azimuths", [(0, 90), (20, 110), (0, 60, 120), (0, 45, 90, 135), (0, 90, 180)])
def test_evenly_placed_views_measure_a_circle(azimuths: tuple[float, ...]) -> None:
    cameras = [camera(a) for a in azimuths]
    assert_allclose([radius_measured(cameras, a) for a in np.linspace(0, 6, 9)], 1)


def test_views_from_one_side_or_its_back_tell_no_depth() -> None:
    assert is_one_sided([camera(0)])
    assert is_one_sided([camera(0), camera(20)])
    assert is_one_sided([camera(5), camera(180)])
    assert not is_one_sided([camera(0), camera(40)])
