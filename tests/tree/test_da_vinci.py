"""Da Vinci's rule: sums at forks by hand and on random trees, and what is measured."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.tree.da_vinci import FAINT_PX, DaVinci, radius_shares, stem_radius, tapered
from forestgen.tree.skeleton import Skeleton, n_children, tips_beyond
from tests.tree.skeletons import random_tree
from tests.tree.solids import ball, camera, views_of

#  3   4
#   \ /
#    1   2     every tip is one particle, so a node's area counts the particles above it
#     \ /
#      0
PARENT = np.array([-1, 0, 0, 1, 1])
POSITION = np.array([[0, 0, 0], [-1, 1, 0], [1, 1, 0], [-2, 2, 0], [0, 2, 0]], float)


def unmeasured(skeleton: Skeleton, stem: float = 0.3) -> Skeleton:
    radius = np.full(len(skeleton), np.nan)
    radius[0] = stem
    return Skeleton(skeleton.position, skeleton.parent, radius)


def test_da_vinci_counts_the_tips_beyond_each_node() -> None:
    assert tips_beyond(PARENT).tolist() == [3, 2, 1, 1, 1]


def test_da_vinci_adds_cross_sections_at_each_fork() -> None:
    unknown, tips = np.full(5, np.nan), tips_beyond(PARENT)
    assert_allclose(tapered(PARENT, radius_shares(PARENT, tips), np.sqrt(3.0), unknown), np.sqrt([3, 2, 1, 1, 1]))
    cubes = radius_shares(PARENT, tips, exponent=3.0)
    assert_allclose(tapered(PARENT, cubes, np.cbrt(3.0), unknown), np.cbrt([3, 2, 1, 1, 1]))


@pytest.mark.parametrize(("exponent", "constant"), [(2.0, 1.0), (2.5, 1.0), (2.0, 1.1)])
def test_the_sum_holds_at_every_fork_of_a_grown_tree(exponent: float, constant: float) -> None:
    tree = unmeasured(random_tree(5000, rng=np.random.default_rng(3)))
    radius = DaVinci(exponent=exponent, constant=constant, measured=False)(tree, []).radius
    total = np.zeros(len(tree))
    np.add.at(total, tree.parent[1:], radius[1:] ** exponent)
    fork = n_children(tree.parent) > 1
    assert fork.sum() > 100
    assert_allclose(radius[fork] ** exponent, constant * total[fork], rtol=1e-9)
    single = np.flatnonzero(~fork[tree.parent[1:]]) + 1
    assert_allclose(radius[single], radius[tree.parent[single]], rtol=1e-12)
    assert radius[0] == 0.3
    assert (radius > 0).all()


def test_all_tips_of_the_printed_rule_are_alike() -> None:
    tree = unmeasured(random_tree(3000, rng=np.random.default_rng(4)))
    radius = DaVinci(measured=False)(tree, []).radius
    tips = radius[n_children(tree.parent) == 0]
    assert_allclose(tips, 0.3 / np.sqrt(len(tips)), rtol=1e-9)


def test_measured_wood_keeps_its_radius_and_nothing_grows_outward() -> None:
    tree = random_tree(2000, rng=np.random.default_rng(5))
    known = tree.radius > 0.01  # photos show the thicker wood; it tapers
    tree = Skeleton(tree.position, tree.parent, np.where(known, tree.radius, np.nan))
    radius = DaVinci()(tree, []).radius
    assert (radius[1:] <= radius[tree.parent[1:]] + 1e-15).all()
    thick = tree.radius > 0.03  # well before what is not measured
    assert_allclose(radius[thick], tree.radius[thick], rtol=1e-12)
    assert (radius[known] <= tree.radius[known] + 1e-15).all()
    assert (radius > 0).all()


def test_measured_wood_thins_to_what_goes_on_from_it() -> None:
    position = np.column_stack([np.zeros(31), 0.2 * np.arange(31), np.zeros(31)])  # 3 m measured, 3 m not
    bush = np.array([[x, 0.2, 0.0] for x in np.linspace(1, 2, 99)])
    parent = np.concatenate([[-1], np.arange(30), np.zeros(99, int)])
    known = np.concatenate([np.full(16, 0.1), np.full(114, np.nan)])
    radius = DaVinci()(Skeleton(np.concatenate([position, bush]), parent, known), []).radius
    assert radius[20] == pytest.approx(0.01, rel=1e-9)  # one tip of a hundred
    assert radius[5] == 0.1
    assert np.diff(radius[:31]).min() >= -0.05 * 0.2 - 1e-12


def test_a_slip_of_the_measuring_does_not_strangle_what_lies_beyond() -> None:
    line = np.array([-1, 0, 1, 2])
    known = np.array([0.2, 0.05, 0.15, np.nan])
    assert_allclose(tapered(line, np.ones(4), 0.2, known), [0.2, 0.15, 0.15, 0.15])
    assert_allclose(tapered(line, np.ones(4), 0.2, np.array([0.2, np.nan, 0.3, 0.1])), [0.2, 0.2, 0.2, 0.1])


def test_applying_the_rule_twice_changes_nothing() -> None:
    tree = unmeasured(random_tree(500, rng=np.random.default_rng(7)))
    for rule in (DaVinci(), DaVinci(measured=False)):
        once = rule(tree, [])
        assert_allclose(rule(once, []).radius, once.radius, rtol=1e-12)


def test_the_stem_is_as_thick_as_it_mostly_was_below_the_first_fork() -> None:
    position = np.array([[0, 0, 0], [0, 1, 0], [0, 2, 0], [-1, 3, 0], [1, 3, 0]], float)
    tree = Skeleton(position, np.array([-1, 0, 1, 2, 2]), np.array([0.5, 0.2, 0.21, 0.1, np.nan]))
    assert stem_radius(tree, tips_beyond(tree.parent)) == 0.21  # not the flare at the ground
    unknown = Skeleton(position, tree.parent, np.full(5, np.nan))
    assert stem_radius(unknown, tips_beyond(tree.parent)) > 0


@pytest.mark.parametrize("fields", [{"exponent": 0.5}, {"constant": 0.9}, {"exponent": float("nan")}])
def test_senseless_parameters_are_refused(fields: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="expected 1 to"):
        DaVinci(**fields)  # type: ignore[arg-type]


def test_a_single_particle_is_a_stem() -> None:
    line = Skeleton(POSITION[:2], np.array([-1, 0]), np.array([0.2, np.nan]))
    assert DaVinci()(line, []).radius.tolist() == [0.2, 0.2]


def test_thin_wood_is_hardly_seen_before_the_sky() -> None:
    seen_by = camera()
    (view,) = views_of(ball((0.0, 5.0, 0.0), 2.0), cameras=(seen_by,))
    #  stem to the crown's middle, a twig in it, and one beside the crown
    position = np.array([[0, 0, 0], [0, 5, 0], [0.5, 5.5, 0], [0, 2, 0], [2.5, 2, 0.0]])
    known = np.array([0.3, 0.3, np.nan, 0.3, np.nan])
    skeleton = Skeleton(position[[0, 3, 1, 2, 4]], np.array([-1, 0, 1, 2, 1]), known[[0, 3, 1, 2, 4]])
    usual, thin = (DaVinci(slender=slender)(skeleton, [view]).radius for slender in (0.0, 1.0))
    assert thin[4] == pytest.approx(FAINT_PX / seen_by.px_per_metre)
    assert thin[4] < usual[4] / 2
    np.testing.assert_array_equal(thin[:4], usual[:4])
