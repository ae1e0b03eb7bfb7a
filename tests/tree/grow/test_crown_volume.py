"""The crown's volume: the silhouette bounds it across, the turned outline in depth."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from forestgen.errors import StageError
from forestgen.tree.grow.crown_volume import crown_volume
from forestgen.tree.mattes import Mattes
from tests.tree.grow.crowns import SIZE, ball_view, cone_view, trunk_matte, view_of


def test_a_ball_of_leaves_stays_a_ball() -> None:
    volume = crown_volume([ball_view()])
    points = np.random.default_rng(0).uniform([-4, 3, -4], [4, 11, 4], (20000, 3))
    away = np.linalg.norm(points - [0, 7, 0], axis=1)
    _, end = volume.allows(points)
    assert volume.height == pytest.approx(10, abs=0.05)
    assert end[away < 2.6].mean() > 0.97
    # the rim keeps a little thickness, and the depth is smoothed along the height
    assert not end[away > 3.5].any()
    assert end[away > 3.2].mean() < 0.02


def test_nothing_is_allowed_along_the_bare_trunk() -> None:
    volume = crown_volume([ball_view()])
    trunk = np.column_stack([np.zeros(20), np.linspace(0, 3.5, 20), np.zeros(20)])
    assert not volume.allows(trunk)[1].any()
    assert volume.sample(0.4, np.random.default_rng(1))[:, 1].min() > 3.5


def test_samples_are_even() -> None:
    volume = crown_volume([ball_view()])
    points = volume.sample(0.5, np.random.default_rng(2))
    assert len(points) == pytest.approx(4 / 3 * np.pi * 3**3 / 0.5**3, rel=0.15)
    assert np.linalg.norm(points.mean(axis=0) - [0, 7, 0]) < 0.15
    below, above = (points[:, 2] < 0).sum(), (points[:, 2] > 0).sum()
    assert below == pytest.approx(above, rel=0.15)


def test_a_long_segment_may_not_leap_over_the_sky() -> None:
    leaves = cv2.circle(np.zeros(SIZE[::-1], np.uint8), (105, 110), 40, 1, -1)
    cv2.circle(leaves, (195, 110), 40, 1, -1)  # 10 px of sky between two clumps, half a metre from either's middle
    leaves[100:120, 140:160] = 0
    leaves[148:150, 100:200] = 1
    volume = crown_volume([view_of(leaves, trunk_matte() * 0 + leaves * 0)])
    left, right = np.array([[-0.7, 7.0, 0]]), np.array([[0.7, 7.0, 0]])
    assert volume.allows(left)[0].all()
    assert volume.allows(right)[0].all()
    assert not volume.spans(left, right).any()
    assert volume.spans(left, left - [0.6, 0, 0]).all()


def test_a_side_view_replaces_the_turned_outline() -> None:
    volume = crown_volume([ball_view(), ball_view(azimuth=np.pi / 2)])
    assert volume.turned is None
    assert volume.allows(np.array([[0.0, 7, 2.7]]))[1].all()
    assert not volume.allows(np.array([[0.0, 7, 3.3]]))[0].any()


def test_a_bare_tree_has_its_twigs_for_a_crown() -> None:
    wood = trunk_matte()
    wood[60:170:4, 80:220] = 1
    view = view_of(np.zeros_like(wood), wood)
    outline = np.array([[75.0, 55], [225, 55], [225, 175], [75, 175]])
    volume = crown_volume([replace(view, strokes=replace(view.strokes, crown=outline))])
    assert len(volume.sample(0.4, np.random.default_rng(0))) > 50
    trunk = np.column_stack([np.zeros(20), np.linspace(0, 4, 20), np.zeros(20)])
    assert not volume.allows(trunk)[1].any()


def test_a_view_without_a_crown_is_refused() -> None:
    nothing = np.zeros(SIZE[::-1], np.uint8)
    view = cone_view()
    with pytest.raises(StageError, match="nothing of the tree"):
        crown_volume([view_like(view, nothing)])


def view_like(view, matte):
    return replace(view, mattes=Mattes(matte.astype(np.float32), matte.astype(np.float32)))
