"""Twigs by phyllotaxis: angles by hand, bends, the crown's bounds, and the contract of `grow`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.errors import StageError
from forestgen.tree.density import DensityVolume
from forestgen.tree.grow.crown_volume import CrownVolume
from forestgen.tree.grow.phyllotaxis import PhyllotaxisTwigs
from forestgen.tree.grow.phyllotaxis_shoots import Buds, ShootRules, bent, buds_on, grow_shoots
from forestgen.tree.grow.phyllotaxis_volume import dense_volume, masses_of
from forestgen.tree.skeleton import Skeleton, path_length
from forestgen.tree.view import View
from tests.tree.grow.crowns import ball_view, two_limbs

RULES = ShootRules(
    length=1.0, spacing=0.5, divergence=np.deg2rad(137.5), per_node=1, insertion=0.9, plagiotropism=0.0, rigidity=1.0
)
UPRIGHT = Skeleton(
    np.column_stack([np.zeros(41), np.linspace(0, 10, 41), np.zeros(41)]), np.arange(41) - 1, np.full(41, 0.05)
)


@pytest.fixture(scope="module")
def views() -> list[View]:
    return [ball_view(), ball_view(np.pi / 2)]


@pytest.fixture(scope="module")
def volume(views: list[View]) -> CrownVolume:
    return dense_volume(views, 48)


def lifted() -> Skeleton:
    tree = two_limbs()
    return replace(tree, radius=np.where(np.isnan(tree.radius), 0.03, tree.radius))


def turns(buds: Buds) -> np.ndarray:
    """Angles about an upright bearer from each bud to the next, radians in [0, 2 pi)."""
    angle = np.arctan2(buds.heading[:, 0], buds.heading[:, 2])
    return np.asarray(np.diff(angle) % (2 * np.pi))


@pytest.mark.parametrize("degrees", [137.5, 90.0, 180.0])
def test_successive_twigs_turn_by_the_divergence(degrees: float) -> None:
    rules = replace(RULES, divergence=np.deg2rad(degrees))
    rng = np.random.default_rng(0)
    many = np.concatenate([turns(buds_on(UPRIGHT, np.ones(41, bool), rules, rng=rng)) for _ in range(30)])
    middle = np.exp(1j * many).mean()
    assert abs(np.rad2deg(np.angle(middle))) == pytest.approx(degrees, abs=2)
    assert abs(middle) > 0.9  # of a unit vector: the jitter is small


def test_two_per_node_stand_opposite_each_other() -> None:
    rules = replace(RULES, per_node=2, divergence=np.pi / 2)
    buds = buds_on(UPRIGHT, np.ones(41, bool), rules, rng=np.random.default_rng(1))
    assert_array_equal(buds.node[::2], buds.node[1::2])
    flat = buds.heading * [1, 0, 1]
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert ((flat[::2] * flat[1::2]).sum(axis=1) < -0.7).all()


def test_buds_are_as_frequent_as_asked_and_only_where_wood_bears() -> None:
    bears = np.arange(41) >= 20
    buds = buds_on(UPRIGHT, bears, RULES, rng=np.random.default_rng(2))
    assert set(buds.node) == set(range(20, 41, 2))  # a node each 0.25 m, a twig each 0.5 m


def test_twigs_near_a_branch_end_are_shorter() -> None:
    buds = buds_on(UPRIGHT, np.ones(41, bool), RULES, rng=np.random.default_rng(3))
    assert buds.length[buds.node > 38].mean() < 0.6 * buds.length[buds.node < 30].mean()


def test_plagiotropic_twigs_come_to_lie_level_and_weak_ones_hang() -> None:
    steep = np.array([[0.5, 0.8, 0.0]]) / np.hypot(0.5, 0.8)
    assert_allclose(bent(steep, replace(RULES, plagiotropism=1.0), 1.0), [[1, 0, 0]], atol=1e-6)
    assert bent(steep, replace(RULES, plagiotropism=-0.5), 1.0)[0, 1] > steep[0, 1]
    assert_allclose(bent(steep, RULES, 1.0), steep, atol=1e-9)  # neither
    assert bent(steep, replace(RULES, rigidity=0.3), 1.0)[0, 1] < steep[0, 1]
    upright = np.array([[0.0, 1.0, 0.0]])
    assert_allclose(bent(upright, replace(RULES, rigidity=0.0), 1.0), upright, atol=1e-6)  # weight has no lever


def test_shoots_stop_at_the_crown_and_hang_on_their_buds(volume: CrownVolume) -> None:
    start = Skeleton(np.array([[0.0, 0, 0], [0, 7, 0]]), np.array([-1, 0]), np.array([0.1, 0.1]))
    way = np.array([[1.0, 0, 0], [0, 0, 1], [-1, 0, 0]])
    buds = Buds(np.array([1, 1, 1]), way, np.array([20.0, 2.0, 1.0]))
    grown = grow_shoots(start, buds, volume, RULES, rng=np.random.default_rng(0))
    assert len(grown) == 2 + 5 + 5  # the first one's first internode leaves the crown
    reach = path_length(grown.position, grown.parent) - 7
    assert_allclose([reach[6], reach[11]], [2.0, 1.0], rtol=1e-9)
    assert volume.allows(grown.position[2:])[1].all()
    assert np.isnan(grown.radius[2:]).all()


def test_twigs_fill_the_crown_that_both_views_show(views: list[View], volume: CrownVolume) -> None:
    grown = PhyllotaxisTwigs(density_resolution=48)(lifted(), views, rng=np.random.default_rng(0))
    ball = np.random.default_rng(1).normal(size=(4000, 3))
    ball *= (2.6 * np.random.default_rng(2).random(4000) ** (1 / 3) / np.linalg.norm(ball, axis=1))[:, None]
    ball += [0.0, 7.0, 0.0]
    inside = ball[volume.allows(ball)[1]]
    near = np.min([np.linalg.norm(inside - p, axis=1) for p in grown.position[grown.position[:, 1] > 3]], axis=0)
    assert np.percentile(near, 95) < 0.5  # metres of a tree of 10: no bare region


def test_the_main_branches_stay_and_all_else_is_new_and_inside(views: list[View], volume: CrownVolume) -> None:
    main = lifted()
    grown = PhyllotaxisTwigs(density_resolution=48)(main, views, rng=np.random.default_rng(0))
    fixed = np.isfinite(grown.radius)
    first = int(fixed.sum())
    assert fixed[:first].all()
    where = [np.flatnonzero((grown.position[:first] == place).all(axis=1)) for place in main.position]
    assert [len(w) for w in where] == [1] * len(main)
    assert (np.diff(np.concatenate(where)) > 0).all()
    tip = np.setdiff1d(np.arange(first, len(grown)), grown.parent)
    assert len(tip) > 300
    on_foliage = np.ones(len(tip), bool)  # sprays reach to the very outline, where no twig in space may end
    for camera, shown in zip(volume.cameras, volume.shown, strict=True):
        column, row = np.floor(camera.project(grown.position[tip])).astype(int).T
        on_foliage &= shown[row, column]
    assert (volume.allows(grown.position[tip])[1] | on_foliage).all()


def test_wood_too_thick_for_twigs_bears_none(views: list[View]) -> None:
    main = lifted()
    grown = PhyllotaxisTwigs(density_resolution=48, bearer=0.3)(main, views, rng=np.random.default_rng(0))
    first = int(np.isfinite(grown.radius).sum())
    bearers = grown.parent[first:][grown.parent[first:] < first]
    assert grown.radius[bearers].max() <= 0.3 * 0.15 + 1e-12


def test_the_same_seed_gives_the_same_tree_and_another_another(views: list[View]) -> None:
    rule = PhyllotaxisTwigs(density_resolution=32, orders=1)
    one, two, other = (rule(lifted(), views, rng=np.random.default_rng(seed)) for seed in (0, 0, 1))
    assert_array_equal(one.position, two.position)
    assert one.position.shape != other.position.shape or not np.allclose(one.position, other.position)


def test_the_paper_setting_grows_regular_twigs_only(views: list[View]) -> None:
    grown = PhyllotaxisTwigs.paper()(lifted(), views, rng=np.random.default_rng(0))
    assert len(grown) > len(lifted())
    none = replace(PhyllotaxisTwigs.paper(), orders=0)(lifted(), views, rng=np.random.default_rng(0))
    assert np.isfinite(none.radius).all()


def test_compound_leaves_get_twigs_of_their_own(views: list[View]) -> None:
    plain = PhyllotaxisTwigs(complete=False, orders=1, density_resolution=32)
    simple = plain(lifted(), views, rng=np.random.default_rng(0))
    compound = replace(plain, compound=0.03)(lifted(), views, rng=np.random.default_rng(0))
    assert len(compound) > 1.5 * len(simple)


def test_one_view_takes_the_crown_as_round() -> None:
    grown = PhyllotaxisTwigs(density_resolution=48)(lifted(), [ball_view()], rng=np.random.default_rng(0))
    crown = grown.position[grown.position[:, 1] > 4]
    assert np.ptp(crown[:, 2]) == pytest.approx(np.ptp(crown[:, 0]), rel=0.2)


def test_views_that_share_nothing_are_told(views: list[View]) -> None:
    aside = ball_view(np.pi / 2)
    low = replace(aside, camera=replace(aside.camera, root_px=(aside.camera.root_px[0], -400.0)))
    with pytest.raises(StageError):
        PhyllotaxisTwigs()(lifted(), [views[0], low], rng=np.random.default_rng(0))


def test_masses_are_filled_where_the_density_is() -> None:
    alpha = np.zeros((4, 5, 3))
    alpha[1, 2, 2] = alpha[3, 4, 0] = 0.5
    density = DensityVolume(alpha, np.array([-1.0, 0.0, 2.0]), 0.5)
    for azimuth in (0.0, 0.7, np.pi / 2):
        masses = masses_of(density, ball_view(azimuth).camera)
        points = np.random.default_rng(0).uniform([-1, 0, 2], [1, 2.5, 3.5], (3000, 3))
        agree = masses.contains(points) == (density.at(points) > 0)
        assert agree.mean() > (0.99 if azimuth != 0.7 else 0.9)


@pytest.mark.parametrize("fields", [{"length": 0.0}, {"rigidity": 2.0}, {"plagiotropism": -3.0}, {"per_node": 0}])
def test_senseless_parameters_are_refused(fields: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="expected"):
        PhyllotaxisTwigs(**fields)  # type: ignore[arg-type]
