"""Grafting: units by hand, their form from the visible tree, levels, crown and bounds."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from forestgen.tree.grow.crown_volume import crown_volume
from forestgen.tree.grow.grafting import Grafting, next_sites, visible_sites
from forestgen.tree.grow.grafting_units import (
    NODES,
    Grafts,
    Sites,
    Spread,
    UnitForm,
    bent_upward,
    estimated_form,
    graft,
    l_units,
    y_units,
)
from forestgen.tree.skeleton import Skeleton, n_children
from tests.tree.grow.crowns import ball_view, two_limbs

EXACT = UnitForm(
    lean=Spread(np.deg2rad(50), 0.0, 0.0, np.pi),
    turn=Spread(np.deg2rad(120), 0.0, 0.0, 2 * np.pi),
    bend=Spread(0.0, 0.0, -1.0, 1.0),
    scale=Spread(0.5, 0.0, 0.0, 1.0),
)
UP = np.array([[0.0, 1.0, 0.0]])


def stem(n: int = 3) -> Skeleton:
    return Skeleton(np.column_stack([np.zeros(n), np.arange(float(n)), np.zeros(n)]), np.arange(n) - 1, np.full(n, 0.1))


def regular_tree(lean_deg: float, turn_deg: float, scale: float) -> Skeleton:
    """A stem of 10 m with straight side branches, by fixed angles and sizes."""
    position, parent = [np.array([0.0, y, 0.0]) for y in range(11)], [-1, *range(10)]
    for k, y in enumerate(range(2, 10)):
        lean, turn = np.deg2rad(lean_deg), np.deg2rad(k * turn_deg)
        heading = np.array([np.sin(lean) * np.cos(turn), np.cos(lean), -np.sin(lean) * np.sin(turn)])
        for step in range(1, 4):
            parent.append(y if step == 1 else len(parent) - 1)
            position.append(np.array([0.0, y, 0.0]) + heading * step * 10 * scale / 3)
    return Skeleton(np.array(position), np.array(parent), np.full(len(parent), 0.1))


def test_an_l_unit_leaves_the_side_and_a_y_unit_parts_at_the_tip() -> None:
    rng = np.random.default_rng(0)
    side = l_units(np.array([1]), UP, np.array([0.0]), np.array([2.0]), EXACT, rng=rng)
    grown, _ = graft(stem(), side, EXACT, None, rng=rng)
    assert_array_equal(grown.parent[3:], [1, 3, 4, 5])
    way = grown.position[-1] - grown.position[1]
    assert_allclose(np.linalg.norm(way), 1.0)  # scale 0.5 of 2 m
    assert_allclose(way[1], np.cos(np.deg2rad(50)))
    assert np.isnan(grown.radius[3:]).all()
    fork, _ = graft(stem(), y_units(np.array([2]), UP, np.array([2.0]), EXACT, rng=rng), EXACT, None, rng=rng)
    assert_array_equal(n_children(fork.parent)[2], 2)
    arms = fork.position[[3, 3 + NODES]] - fork.position[2]
    cosine = arms[0] @ arms[1] / np.prod(np.linalg.norm(arms, axis=1))
    assert_allclose(cosine, np.cos(np.deg2rad(50)))  # the angle between them is an L unit's


def test_units_turn_on_from_the_one_before() -> None:
    before = np.array([0.3, 1.0])
    units = l_units(np.array([0, 1]), np.repeat(UP, 2, axis=0), before, np.ones(2), EXACT, rng=np.random.default_rng(0))
    assert_allclose(units.azimuth - before, np.deg2rad(120))


@pytest.mark.parametrize(("lean", "turn", "scale"), [(40.0, 120.0, 0.3), (65.0, 90.0, 0.5)])
def test_the_form_is_read_from_the_visible_tree(lean: float, turn: float, scale: float) -> None:
    form = estimated_form(regular_tree(lean, turn, scale), 10, 0.5)
    assert_allclose([form.lean.mean, form.scale.mean], [np.deg2rad(lean), scale], rtol=1e-6)
    assert_allclose(abs(np.sin(form.turn.mean)), abs(np.sin(np.deg2rad(turn))), atol=1e-6)
    assert_allclose(form.bend.mean, 0, atol=1e-9)
    assert max(form.lean.sigma, form.scale.sigma, form.bend.sigma) < 1e-6


def test_few_branches_give_the_usual_form() -> None:
    assert estimated_form(two_limbs(), 7, 0.1) == UnitForm()


def test_bending_upward() -> None:
    level, zenith = np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0]])
    assert_allclose(bent_upward(level, np.array([np.pi / 6])), [[np.sqrt(0.75), 0.5, 0]])
    assert_allclose(bent_upward(level, np.array([-np.pi / 6])), [[np.sqrt(0.75), -0.5, 0]])
    assert_allclose(bent_upward(level, np.array([3.0])), zenith, atol=1e-9)  # no farther than up
    assert_allclose(bent_upward(zenith, np.array([1.0])), zenith)


def test_each_level_grows_on_the_one_before() -> None:
    rng = np.random.default_rng(1)
    site = Sites(np.array([2]), UP, np.zeros(1), np.zeros(1), np.array([1.0]))
    _, grafts = graft(stem(), site, EXACT, None, rng=rng)
    units = next_sites(grafts, 2, EXACT, rng=rng)
    assert_array_equal(units.node, [6, 6, 3, 4])  # two at the tip, one at each inner node
    assert_allclose(units.length, 0.5)
    cut = Grafts(np.array([[3, -1, -1, -1]]), grafts.ahead, grafts.azimuth, np.array([0.25]))
    assert_array_equal(next_sites(cut, 2, EXACT, rng=rng).node, [3, 3])  # a branch cut short has no side


def test_visible_branches_get_units_at_tip_and_side() -> None:
    sites = visible_sites(two_limbs(), 7, 0.5, 0.5, EXACT, rng=np.random.default_rng(0))
    tips = np.flatnonzero(n_children(two_limbs().parent) == 0)
    counts = np.bincount(sites.node, minlength=13)
    assert (counts[tips] == 2).all()
    assert counts[:4].sum() == 0  # the lower trunk is bare
    assert counts[4:7].sum() > 0
    nothing = Skeleton(np.zeros((1, 3)), np.array([-1]), np.array([0.1]))
    assert len(visible_sites(nothing, 0, 0.5, 0.5, EXACT, rng=np.random.default_rng(0))) == 0


def grown(settings: Grafting, seed: int = 0) -> Skeleton:
    return settings(two_limbs(), [ball_view()], rng=np.random.default_rng(seed))


def test_the_papers_setting_grows_levels_and_no_more() -> None:
    one, two, three = (grown(Grafting(levels=n, inside_crown=False, complete=False)) for n in (1, 2, 3))
    assert len(one) < len(two) < len(three)
    assert_array_equal(two.position[: len(one)], one.position)  # a level adds to those before
    assert Grafting.paper() == Grafting(inside_crown=False, complete=False, leaf_masses=False)
    assert len(grown(Grafting(levels=0, inside_crown=False, complete=False))) < len(one)


def outside(skeleton: Skeleton, first: int) -> NDArray[np.bool_]:
    return ~crown_volume([ball_view()]).allows(skeleton.position[first:])[0]


def test_units_end_where_the_crown_does() -> None:
    free = grown(Grafting(inside_crown=False, complete=False, leaf_masses=False))
    kept = grown(Grafting(complete=False, leaf_masses=False))
    n = len(grown(Grafting(levels=0, complete=False, leaf_masses=False)))
    assert outside(free, n).mean() > 0.05
    assert outside(kept, n).sum() == 0
    assert len(kept) > n + 100


def test_the_default_reaches_all_of_the_crown() -> None:
    tree = grown(Grafting(least_twigs=300, most_twigs=600))
    volume = crown_volume([ball_view()])
    points = volume.sample(0.6, np.random.default_rng(3))
    away = np.linalg.norm(points[:, None] - tree.position[None], axis=2).min(axis=1)
    assert np.quantile(away, 0.9) < 1.2  # m, of a crown 6 m wide that has lobes
    steps = np.linalg.norm(np.diff(tree.position, axis=0), axis=1)
    assert np.isfinite(steps).all()


def test_the_number_of_branches_is_bounded() -> None:
    most = grown(Grafting(levels=5, most=50, inside_crown=False, complete=False))
    few = grown(Grafting(levels=0, inside_crown=False, complete=False))
    assert len(most) <= len(few) + 5 * 50 * NODES


def test_bad_settings_are_refused() -> None:
    with pytest.raises(ValueError, match="levels is 9; expected at most 8"):
        Grafting(levels=9)
    for name, value in {"levels": -1, "interval": 0.0, "sides": -1, "most": -1}.items():
        with pytest.raises(ValueError, match=f"{name} is {value}; expected at least"):
            Grafting(**{name: value})  # type: ignore[arg-type]
