"""Leaf masses: lobes like the photo's outline all round, gaps between, and never outside the silhouette."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.arrays import stage_rng
from forestgen.tree.grow.axes import axes_of
from forestgen.tree.grow.boughs import boughs_of, steepness
from forestgen.tree.grow.crown_volume import CrownVolume, crown_volume
from forestgen.tree.grow.drawn_in import drawn_in
from forestgen.tree.grow.growth_form import is_tiered
from forestgen.tree.grow.leaf_masses import Hull, apart, fill_cells, leaf_masses, lobe_sizes
from forestgen.tree.grow.subtree_replacement import SubtreeReplacement
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View
from tests.tree.grow.crowns import PX, SIZE, ball_view, cone_view, trunk_matte, two_limbs, view_of


def lobed_view() -> View:
    """A ball of leaves with five lobes and notches between them."""
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    radius = 85 * (1 + 0.2 * np.cos(5 * angle))
    outline = np.column_stack([150 + radius * np.cos(angle), 110 + radius * np.sin(angle)])
    leaves = cv2.fillPoly(np.zeros(SIZE[::-1], np.uint8), [np.rint(outline).astype(np.int32)], 1)
    return view_of(leaves, trunk_matte())


def with_masses(view: View, seed: int = 0) -> CrownVolume:
    volume = crown_volume([view])
    assert volume.turned is not None
    rng = stage_rng(seed, "grow")
    hull = Hull.of(volume.turned, rng=rng)
    sizes = lobe_sizes(volume.leafy[0], PX, volume.height)
    masses = leaf_masses(volume.leafy[0], view.camera, hull, sizes, volume.height, np.zeros((0, 3)), rng=rng)
    return replace(volume, masses=masses)


def reach_by_azimuth(points: np.ndarray) -> np.ndarray:
    """The farthest of points (N, 3) from the trunk in each of 36 directions."""
    sector = (np.degrees(np.arctan2(points[:, 2], points[:, 0])) // 10).astype(int) % 36
    return np.array([np.hypot(*points[sector == s][:, [0, 2]].T).max(initial=0) for s in range(36)])


def unevenness(points: np.ndarray) -> float:
    """How unequal the reach is in different directions, on average over level slices half a metre thick."""
    slices = [reach_by_azimuth(points[np.abs(points[:, 1] - up) < 0.25]) for up in np.arange(5.5, 9, 0.5)]
    return float(np.mean([reach.std() / reach.mean() for reach in slices]))


def test_a_crown_from_above_is_no_circle_but_as_uneven_as_its_outline() -> None:
    for view in (ball_view(), lobed_view()):
        round_, lobed = (v.sample(0.1, stage_rng(1, "probe")) for v in (crown_volume([view]), with_masses(view)))
        assert unevenness(lobed) > unevenness(round_) + 0.03
        assert unevenness(lobed) < 0.4


def test_masses_cover_the_foliage_in_the_picture_and_stay_in_it() -> None:
    view = lobed_view()
    volume = with_masses(view)
    points = volume.sample(0.08, stage_rng(1, "probe"))
    column, row = np.floor(view.camera.project(points)).astype(int).T
    assert view.mattes.is_foliage[row, column].all()
    seen = np.zeros(SIZE[::-1], bool)
    seen[row, column] = True
    away = cv2.distanceTransform((~seen).astype(np.uint8), cv2.DIST_L2, 5)
    assert np.quantile(away[volume.leafy[0]], 0.99) < 0.03 * 10 * PX


def test_there_are_gaps_between_masses() -> None:
    plain, lumpy = crown_volume([ball_view()]), with_masses(ball_view())
    points = plain.sample(0.15, stage_rng(1, "probe"))
    share = lumpy.allows(points)[1].mean()
    assert 0.4 < share < 0.95


def test_another_seed_gives_other_lobes() -> None:
    one, other = with_masses(ball_view(), 1), with_masses(ball_view(), 2)
    assert one.masses is not None
    assert other.masses is not None
    assert one.masses.centre.shape != other.masses.centre.shape or not np.allclose(
        one.masses.centre, other.masses.centre
    )


def test_a_wider_lobe_is_measured_as_wider() -> None:
    ball = lobe_sizes(ball_view().mattes.is_foliage, PX, 10.0)
    star = lobe_sizes(lobed_view().mattes.is_foliage, PX, 10.0)
    assert ball.min() >= star.min()
    assert ball.mean() > star.mean()


def test_an_even_outline_gives_an_even_hull() -> None:
    view = view_of(cv2.rectangle(np.zeros(SIZE[::-1], np.uint8), (90, 20), (210, 200), 1, -1), trunk_matte())
    turned = crown_volume([view]).turned
    assert turned is not None
    hull = Hull.of(turned, rng=stage_rng(0, "grow"))
    azimuth = np.linspace(0, 6, 50)
    assert_allclose(hull.radius(azimuth, np.full(50, 7.0)), 2.0, rtol=0.05)
    lobed = Hull.of(crown_volume([lobed_view()]).turned, rng=stage_rng(0, "grow"))  # type: ignore[arg-type]
    assert np.ptp(lobed.radius(np.linspace(1, 2.2, 50), np.full(50, 7.0))) > 0.1


def test_balls_too_near_to_earlier_ones_are_left_out() -> None:
    place = np.array([[0.0, 0, 0], [1.0, 0, 0], [3.0, 0, 0], [3.1, 0, 0]])
    assert apart(place, np.ones(4)).tolist() == [0, 2]
    assert apart(np.zeros((0, 3)), np.zeros(0)).tolist() == []


def test_cells_of_one_ball() -> None:
    masses = fill_cells(np.array([[1.0, 2, 3]]), np.array([0.5]), 1.0, np.eye(3), 0.02)
    rng = np.random.default_rng(0)
    off = rng.uniform(-0.7, 0.7, (5000, 3))
    points, away = off + np.array([1, 2, 3]), np.linalg.norm(off, axis=1)
    inside = masses.contains(points)
    assert inside[away < 0.46].all()
    assert not inside[away > 0.54].any()
    skin = masses.in_front(np.array([[1.0, 2, 3.45], [1, 2, 3.2], [1, 2, 2], [1, 5, 3]]), 0.2)
    assert skin.tolist() == [True, False, False, False]


def test_a_branch_outside_the_crown_is_drawn_in_and_stays_in_the_picture() -> None:
    view = ball_view()
    turned = crown_volume([view]).turned
    assert turned is not None
    position = two_limbs().position.copy()
    position[10, 2] = 6.0  # far before the crown
    far = Skeleton(position, two_limbs().parent, two_limbs().radius)
    near = drawn_in(far, view.camera, turned)
    assert_allclose(view.camera.project(near.position), view.camera.project(position), atol=1e-9)
    assert 0 < near.position[10, 2] < 3.0
    rest = np.arange(13) != 10
    assert_allclose(near.position[rest], position[rest])
    assert drawn_in(two_limbs(), view.camera, turned) is not None


def test_boughs_are_longer_below_and_all_round() -> None:
    view = cone_view()
    volume = crown_volume([view])
    assert volume.turned is not None
    assert is_tiered("excurrent", volume.turned)
    assert not is_tiered("decurrent", volume.turned)
    rng = stage_rng(0, "grow")
    hull = Hull.of(volume.turned, rng=rng)
    stem = np.column_stack([np.zeros(40), np.linspace(0, 9.8, 40), np.zeros(40)])
    boughs = boughs_of(stem, hull, volume, 0.4, -0.2, rng=rng)
    assert len(boughs) > 25
    reach = np.array([np.hypot(b.points[-1, 0], b.points[-1, 2]) for b in boughs])
    tip = np.array([b.points[-1] for b in boughs])
    assert reach[tip[:, 1] < 4].mean() > 1.5 * reach[tip[:, 1] > 6].mean()
    quarter = np.bincount((np.degrees(np.arctan2(tip[:, 2], tip[:, 0])) // 90).astype(int) + 2, minlength=4)
    assert quarter.min() >= 0.12 * quarter.sum()
    may_pass, _ = crown_volume([view], is_round=False).allows(np.concatenate([b.points for b in boughs]))
    assert may_pass.mean() > 0.97


def test_steepness_is_measured_in_the_picture() -> None:
    tree = two_limbs()
    right = np.array([1.0, 0, 0])
    ends = [tree.position[10] - tree.position[4], tree.position[12] - tree.position[5]]
    wanted = np.median([end[1] / abs(end[0]) for end in ends])
    assert steepness(tree.position, axes_of(tree, 7), right, 10.0) == pytest.approx(np.clip(wanted, -0.8, 1.5))
    assert steepness(tree.position, axes_of(tree, 7)[:2], right, 10.0) == 0.0


def test_grown_wood_keeps_off_the_sky_inside_the_crown() -> None:
    view = ball_view()
    leaves = view.mattes.is_foliage.astype(np.uint8)
    cv2.circle(leaves, (185, 95), 22, 0, -1)  # a hole of sky, 1.5 m wide, in the right half
    holed = view_of(leaves, trunk_matte())
    tree = SubtreeReplacement()(two_limbs(), [holed], rng=stage_rng(1, "grow"))
    new = tree.position[np.isnan(tree.radius)]
    away = np.linalg.norm(holed.camera.project(new) - (185.5, 95.5), axis=1)
    assert (away < 17).mean() < 0.002
