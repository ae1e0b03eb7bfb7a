"""Boughs along the line of sight rise like those that are seen, as far as the photo has room."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from forestgen.tree.grow.crown_volume import CrownVolume, crown_volume
from forestgen.tree.grow.rising import UNEVEN, Boughs, rising
from tests.tree.grow.crowns import ball_view

Array = NDArray[Any]
N_TRUNK, N_BOUGH = 31, 10
STEM = np.arange(N_TRUNK)
FOOT = 16  # 4.8 m up
SLOPE = 0.6


def level_bough(way: tuple[float, float, float]) -> tuple[Array, Array]:
    """A trunk 9 m tall and a bough on it along `way`, metres, with a twig of one node at its end."""
    trunk = np.column_stack([np.zeros(N_TRUNK), np.linspace(0, 9, N_TRUNK), np.zeros(N_TRUNK)])
    bough = trunk[FOOT] + np.linspace(0, 1, N_BOUGH + 1)[1:, None] * way
    twig = bough[-1:] + np.array([0.0, 0.05, -0.05])
    parent = [-1, *range(N_TRUNK - 1), FOOT, *range(N_TRUNK, N_TRUNK + N_BOUGH - 1), N_TRUNK + N_BOUGH - 1]
    return np.concatenate([trunk, bough, twig]), np.array(parent)


def risen(way: tuple[float, float, float], volume: CrownVolume, n_fixed: int = N_TRUNK) -> Array:
    """How far (N,) the nodes of such a tree rise, metres; they move no other way."""
    position, parent = level_bough(way)
    after, _ = rising(position, parent, n_fixed, Boughs(STEM, SLOPE), volume, rng=np.random.default_rng(3))
    assert_allclose(after[:, [0, 2]], position[:, [0, 2]], atol=1e-12)
    assert_allclose(after[:N_TRUNK], position[:N_TRUNK])
    return np.asarray(after[:, 1] - position[:, 1])


def test_a_level_bough_towards_the_camera_rises() -> None:
    up = risen((0.0, 0.0, 2.0), crown_volume([ball_view()]))
    tip = N_TRUNK + N_BOUGH - 1
    assert abs(up[tip] / 2.0 - SLOPE) < 3 * UNEVEN
    assert (np.diff(up[N_TRUNK : tip + 1]) > 0).all()
    assert up[N_TRUNK] / 0.2 > up[tip] / 2.0  # steeper at the foot
    assert abs(up[tip + 1] - up[tip]) < 0.1  # the twig goes along


def test_what_the_photo_shows_stays() -> None:
    assert not risen((2.0, 0.0, 0.4), crown_volume([ball_view()])).any()
    assert not risen((0.0, 0.0, 2.0), crown_volume([ball_view()]), N_TRUNK + N_BOUGH + 1).any()


def test_a_steep_bough_and_a_short_twig_stay() -> None:
    assert not risen((0.0, 2.5, 2.0), crown_volume([ball_view()])).any()
    assert not risen((0.0, 0.0, 0.3), crown_volume([ball_view()])).any()


def test_a_bough_stays_where_the_photo_has_no_room_above_it() -> None:
    volume = crown_volume([ball_view()])
    row = int(volume.cameras[0].project(np.array([[0.0, 4.9, 0.0]]))[0, 1])
    low = volume.passable[0].copy()
    low[:row] = False
    assert not risen((0.0, 0.0, 2.0), replace(volume, passable=(low,))).any()
