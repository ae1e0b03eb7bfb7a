"""Branches that lifting carried out of the crown bend back into it, and stay where they are in the picture."""

import numpy as np
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from forestgen.tree.grow.crown_volume import crown_volume
from forestgen.tree.grow.drawn_in import drawn_in
from forestgen.tree.grow.turned_outline import TurnedOutline
from forestgen.tree.skeleton import Skeleton
from tests.tree.grow.crowns import ball_view, two_limbs

STEM = 7


def turned_ball() -> TurnedOutline:
    """The crown of `ball_view`: 3 m about (0, 7, 0)."""
    turned = crown_volume([ball_view()]).turned
    assert turned is not None
    return turned


def limb_towards(z: float) -> Skeleton:
    """A trunk with a straight limb of 24 nodes, to the right and `z` m before the trunk, that bears a twig midway."""
    trunk = np.column_stack([np.zeros(8), np.arange(8.0), np.zeros(8)])
    limb = np.array([0.0, 5.0, 0.0]) + np.linspace(0, 1, 25)[1:, None] * [1.5, 1.5, z]
    twig = limb[12] + np.array([[0.1, 0.3, 0.0], [0.2, 0.6, 0.0]])
    parent = np.array([-1, *range(7), 5, *range(8, 31), 20, 32])
    return Skeleton(np.concatenate([trunk, limb, twig]), parent, np.full(34, np.nan))


def turns(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Degrees between the segments of a polyline."""
    way = np.diff(line, axis=0)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    return np.asarray(np.rad2deg(np.arccos(np.clip((way[1:] * way[:-1]).sum(axis=1), -1, 1))))


def test_what_is_within_the_crown_stays() -> None:
    assert_allclose(drawn_in(two_limbs(), ball_view().camera, turned_ball(), STEM).position, two_limbs().position)


def test_a_limb_outside_is_drawn_in_and_stays_in_the_picture() -> None:
    far, camera = limb_towards(6.0), ball_view().camera
    near = drawn_in(far, camera, turned_ball(), STEM)
    assert_allclose(camera.project(near.position), camera.project(far.position), atol=1e-9)
    assert_allclose(near.position[:8], far.position[:8])  # the trunk
    assert 1.0 < near.position[31, 2] < 3.0
    assert (near.position[8:32, 2] > 0).all()


def test_it_bends_and_has_no_elbow() -> None:
    near = drawn_in(limb_towards(6.0), ball_view().camera, turned_ball(), STEM)
    assert turns(near.position[[5, *range(8, 32)]]).max() < 12


def test_what_a_limb_bears_goes_with_it() -> None:
    far = limb_towards(6.0)
    near = drawn_in(far, ball_view().camera, turned_ball(), STEM)
    assert far.position[20, 2] - near.position[20, 2] > 0.5
    assert abs(near.position[32, 2] - near.position[20, 2]) < 0.1
