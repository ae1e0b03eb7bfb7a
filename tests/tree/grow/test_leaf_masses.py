"""Leaf masses: lobes like the photo's outline all round, gaps between, and never outside the silhouette."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.arrays import stage_rng
from forestgen.tree.grow.axes import axes_of
from forestgen.tree.grow.boughs import WIDEST, boughs_of, spray_width, steepness
from forestgen.tree.grow.crown_volume import CrownVolume, crown_volume
from forestgen.tree.grow.growth_form import is_tiered
from forestgen.tree.grow.leaf_masses import FINEST, Hull, apart, fill_cells, leaf_masses, lobe_sizes
from forestgen.tree.grow.subtree_replacement import SubtreeReplacement
from forestgen.tree.grow.turned_outline import DEEPEST, as_deep_as_wide
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


def test_boughs_are_longer_below_and_all_round() -> None:
    view = cone_view()
    volume = crown_volume([view])
    assert volume.turned is not None
    assert is_tiered("excurrent", volume.turned)
    assert not is_tiered("decurrent", volume.turned)
    rng = stage_rng(0, "grow")
    hull = Hull.of(volume.turned, rng=rng)
    stem = np.column_stack([np.zeros(40), np.linspace(0, 9.8, 40), np.zeros(40)])
    boughs = boughs_of(stem, hull, volume, 0.4, -0.2, np.zeros((0, 3)), rng=rng)
    assert len(boughs) > 25
    reach = np.array([np.hypot(b.points[-1, 0], b.points[-1, 2]) for b in boughs])
    tip = np.array([b.points[-1] for b in boughs])
    assert reach[tip[:, 1] < 4].mean() > 1.5 * reach[tip[:, 1] > 6].mean()
    quarter = np.bincount((np.degrees(np.arctan2(tip[:, 2], tip[:, 0])) // 90).astype(int) + 2, minlength=4)
    assert quarter.min() >= 0.12 * quarter.sum()
    may_pass, _ = crown_volume([view], is_round=False).allows(np.concatenate([b.points for b in boughs]))
    assert may_pass.mean() > 0.97


def cone_boughs(seen: np.ndarray) -> np.ndarray:
    """Tips (B, 3) of the boughs of a cone of leaves in which the photo shows some already."""
    volume = crown_volume([cone_view()])
    assert volume.turned is not None
    rng = stage_rng(3, "grow")
    stem = np.column_stack([np.zeros(40), np.linspace(0, 9.8, 40), np.zeros(40)])
    boughs = boughs_of(stem, Hull.of(volume.turned, rng=rng), volume, 0.4, -0.2, seen, rng=rng)
    return np.array([bough.points[-1] for bough in boughs])


def test_boughs_leave_no_direction_empty() -> None:
    tip = cone_boughs(np.zeros((0, 3)))
    unequal = []
    for low, high in ((2, 4), (4, 6), (6, 8)):
        part = tip[(tip[:, 1] >= low) & (tip[:, 1] < high)]
        sector = (np.degrees(np.arctan2(part[:, 2], part[:, 0])) // 45).astype(int) % 8
        count, fair = np.bincount(sector, minlength=8), len(part) / 8
        assert count.min() > 0
        unequal.append(((count - fair) ** 2).sum() / fair)
    assert np.mean(unequal) < 3.5  # azimuths drawn at random: chi squared of 7 degrees of freedom, 7 on average


def test_boughs_keep_off_those_that_the_photo_shows() -> None:
    up = np.repeat(np.linspace(2.5, 7, 40), 12)
    out = np.tile(np.linspace(0.2, 1.5, 12), 40)
    seen = np.column_stack([out * np.cos(0.8), up, out * np.sin(0.8)])  # a sheet of wood on the right, in front
    alone, beside = cone_boughs(np.zeros((0, 3))), cone_boughs(seen)

    def share(tip: np.ndarray) -> float:
        tip = tip[(tip[:, 1] > 2.5) & (tip[:, 1] < 7)]
        return float((np.abs(np.arctan2(tip[:, 2], tip[:, 0]) - 0.8) < 0.3).mean())

    assert share(beside) < 0.3 * share(alone)


def test_sprays_narrow_toward_the_tip_and_have_bounds() -> None:
    width = spray_width(np.array([0.0, 0.5, 1.0]), 2.0, 10.0)
    assert_allclose(width, [0.6, 0.45, 0.3])
    assert spray_width(np.zeros(1), 9.0, 10.0)[0] == pytest.approx(WIDEST * 10)
    assert spray_width(np.ones(1), 0.1, 10.0)[0] == pytest.approx(1.2 * FINEST * 10)


def test_a_crown_with_sky_about_its_trunk_is_as_deep_as_wide() -> None:
    ball = crown_volume([ball_view()])
    assert ball.turned is not None
    whole = as_deep_as_wide(ball.turned, ball.leafy[0], ball_view().camera)
    assert_allclose(whole.depth, ball.turned.depth, rtol=0.05)  # a ball is round as it is
    leaves = ball_view().mattes.is_foliage.astype(np.uint8)
    cv2.rectangle(leaves, (134, 40), (166, 200), 0, -1)
    view = view_of(leaves, trunk_matte())
    volume = crown_volume([view])
    assert volume.turned is not None
    deeper = as_deep_as_wide(volume.turned, volume.leafy[0], view.camera)
    factor = deeper.depth / volume.turned.depth
    assert 1.05 < factor.min() == pytest.approx(factor.max())
    assert factor.max() <= DEEPEST
    rng = np.random.default_rng(0)
    points = volume.low + rng.random((200_000, 3)) * (volume.high - volume.low)
    points[:, 2] *= 1.3
    flat, round_ = (replace(volume, turned=turned) for turned in (volume.turned, deeper))
    spread = [np.std(p[:, 2]) / np.std(p[:, 0]) for p in (points[v.allows(points)[1]] for v in (flat, round_))]
    assert spread[0] < 0.92
    assert spread[1] == pytest.approx(1.0, abs=0.05)


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
