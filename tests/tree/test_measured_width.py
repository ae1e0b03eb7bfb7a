"""MeasuredWidth: what was measured stays, the rest tapers."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.tree.measured_width import MeasuredWidth, measured_width
from forestgen.tree.skeleton import Skeleton

NAN = np.nan
#  a stem of four nodes a metre apart; two more metres unmeasured; a side branch of 2 m at node 2
PLACE = np.array([[0, 0, 0], [0, 1, 0], [0, 2, 0], [0, 3, 0], [0, 4, 0], [0, 5, 0], [1, 2, 0], [2, 2, 0]], float)
PARENT = np.array([-1, 0, 1, 2, 3, 4, 2, 6])


def test_measured_radii_stay_and_the_rest_tapers() -> None:
    radius = np.array([0.5, 0.4, 0.35, 0.3, NAN, NAN, NAN, NAN])
    found = measured_width(Skeleton(PLACE, PARENT, radius), 0.6, 0.01)
    assert_allclose(found[:4], radius[:4])
    assert_allclose(found[4:6], [0.15, 0.005])  # half of the way is left; the tip has the least
    assert_allclose(found[6:], [0.6 * 0.35, 0.005])


def test_a_gap_is_no_thinner_than_what_lies_beyond() -> None:
    radius = np.array([0.5, NAN, NAN, 0.42, NAN, NAN, NAN, NAN])
    found = measured_width(Skeleton(PLACE, PARENT, radius), 0.6, 0.01)
    assert_allclose(found[1:4], 0.42)
    assert found[0] == 0.5


def test_radii_never_grow_outward() -> None:
    rng = np.random.default_rng(0)
    n = 400
    parent = np.array([-1, *(rng.integers(max(0, k - 9), k) for k in range(1, n))])
    radius = np.where(rng.random(n) < 0.3, rng.uniform(0, 0.4, n), NAN)
    found = measured_width(Skeleton(rng.normal(size=(n, 3)), parent, radius), 0.6, 0.02)
    assert (found[1:] <= found[parent[1:]]).all()
    assert (found > 0).all()


def test_nothing_measured_is_in_proportion_to_the_size() -> None:
    found = MeasuredWidth(slender=0.0)(Skeleton(PLACE, PARENT, np.full(8, NAN)), []).radius
    assert_allclose(found[0], 5 / 60)
    point = MeasuredWidth()(Skeleton(PLACE[:1], PARENT[:1], np.full(1, NAN)), []).radius
    assert (point > 0).all()


def test_bad_settings_are_refused() -> None:
    for settings in ({"ratio": 0.0}, {"ratio": 1.5}, {"tip": 0.0}):
        with pytest.raises(ValueError, match=f"{next(iter(settings))} is"):
            MeasuredWidth(**settings)
