"""Radius rules: tiny skeletons with answers by hand, and what holds for every skeleton."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from forestgen.tree.radius import ConstantRatio, MeasuredTaper, carried_length, measured_taper
from forestgen.tree.skeleton import Skeleton

#      3     5
#       \   /
#    4   \ /        the way 0-1-2-3 is the longest: the trunk; 1-4 and 2-5 leave it
#     \   2
#      \ /
#       1
#       0
PARENT = np.array([-1, 0, 1, 2, 1, 2])
POSITION = np.array([[0, 0, 0], [0, 1, 0], [0, 2, 0], [-2, 4, 0], [-1, 2, 0], [1, 3, 0]], float)


def skeleton_of(radius: list[float]) -> Skeleton:
    return Skeleton(POSITION, PARENT, np.array(radius))


def random_skeleton(n: int, rng: np.random.Generator) -> Skeleton:
    parent = np.concatenate([[-1], np.maximum(0, np.arange(1, n) - 1 - rng.geometric(0.4, n - 1))])
    position = np.cumsum(rng.normal(0, 0.1, (n, 3)), axis=0)
    position[1:] = position[parent[1:]] + rng.normal(0, 0.1, (n - 1, 3))
    radius = np.where(rng.random(n) < 0.3, rng.uniform(0.001, 0.2, n), np.nan)
    return Skeleton(position, parent, radius)


def test_constant_ratio_thins_by_branch_and_not_along_it() -> None:
    radius = ConstantRatio()(skeleton_of([0.2] + [np.nan] * 5), []).radius
    assert_allclose(radius, [0.2, 0.2, 0.2, 0.2, 0.15, 0.15])


def test_constant_ratio_is_the_same_when_applied_again() -> None:
    once = ConstantRatio()(skeleton_of([0.2] + [np.nan] * 5), [])
    assert_allclose(ConstantRatio()(once, []).radius, once.radius, rtol=0)


def test_powers_of_radii_add_up_at_a_fork_of_unmeasured_wood() -> None:
    #  2   3
    #   \ /
    #    1      fork in a node that is no length below its children's feet: loads 1 and 3
    #    0
    position = np.array([[0, 0, 0], [0, 1, 0], [-1, 1, 0], [3, 1, 0]], float)
    skeleton = Skeleton(position, np.array([-1, 0, 1, 1]), np.array([0.3, 0.2, np.nan, np.nan]))
    tip = 1e-3 * 5  # each tip counts a thousandth of the whole length
    assert_allclose(carried_length(skeleton), [5 + 2 * tip, 4 + 2 * tip, tip, tip])
    radius = measured_taper(skeleton, 2.0, 1e-9)
    assert_allclose(radius[:2], [0.3, 0.2])
    assert_allclose(radius[2:], 0.2 * np.sqrt(tip / (4 + 2 * tip)))


def test_hidden_wood_lies_between_what_was_measured_before_and_beyond() -> None:
    radius = MeasuredTaper()(skeleton_of([0.3, np.nan, 0.2, np.nan, np.nan, np.nan]), []).radius
    assert radius[0] == 0.3
    assert radius[2] == 0.2
    assert 0.2 <= radius[1] <= 0.3


def test_measured_radii_stay_but_never_grow_outward() -> None:
    radius = MeasuredTaper()(skeleton_of([0.3, 0.1, 0.2, np.nan, 0.05, np.nan]), []).radius
    assert_allclose(radius[[0, 1, 2, 4]], [0.3, 0.1, 0.1, 0.05])


def test_a_tree_that_was_nowhere_measured_is_as_thick_as_its_size_asks() -> None:
    radius = MeasuredTaper()(skeleton_of([np.nan] * 6), []).radius
    assert_allclose(radius[0], (2 + 2 * np.sqrt(2)) / 60)
    assert_allclose(ConstantRatio()(skeleton_of([np.nan] * 6), []).radius[0], radius[0])


@pytest.mark.parametrize("rule", [ConstantRatio(), MeasuredTaper()], ids=lambda r: type(r).__name__)
@pytest.mark.parametrize("seed", range(5))
def test_radii_are_positive_and_fall_from_the_root(rule: ConstantRatio | MeasuredTaper, seed: int) -> None:
    skeleton = random_skeleton(400, np.random.default_rng(seed))
    radius = rule(skeleton, []).radius
    assert np.isfinite(radius).all()
    assert radius.min() > 0
    assert (np.diff(np.stack([radius[1:], radius[skeleton.parent[1:]]]), axis=0) >= 0).all()


def test_a_single_node_has_a_radius() -> None:
    one = Skeleton(np.zeros((1, 3)), np.array([-1]), np.array([np.nan]))
    for rule in (ConstantRatio(), MeasuredTaper()):
        assert rule(one, []).radius[0] > 0


def test_taper_ignores_the_scale_of_the_tree() -> None:
    measured: NDArray[np.float64] = np.array([0.3, np.nan, 0.2, np.nan, np.nan, np.nan])
    small = measured_taper(Skeleton(POSITION, PARENT, measured), 2.3, 0.012)
    large = measured_taper(Skeleton(7 * POSITION, PARENT, 7 * measured), 2.3, 0.012)
    assert_allclose(large, 7 * small)
