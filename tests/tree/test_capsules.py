"""Capsules enclose the thick wood, few and in the same order each time."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.capsules import MOST, ROOM, THICK, Capsules, collision_capsules
from forestgen.tree.growth_binding import bind_mesh
from forestgen.tree.limb_tree import limb_tree
from forestgen.tree.limbs import tree_size
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Bark
from forestgen.tree.skeleton import Skeleton
from tests.tree.skeletons import fork, polyline, random_tree

BARK = Bark(np.full((1, 1, 3), 90, np.uint8), 0.3, 0.3)


def volume(capsules: Capsules) -> float:
    """Sum of the capsules' volumes, m3."""
    length = np.linalg.norm(capsules.end - capsules.start, axis=1)
    return float((np.pi * capsules.radius**2 * (length + 4 / 3 * capsules.radius)).sum())


def test_a_straight_branch_is_one_capsule() -> None:
    far = [[0.0, 0, 0], [0, 1, 0], [0, 2, 0], [1, 1, 0], [2, 1, 0]]
    tree = limb_tree(Skeleton(np.array(far), np.array([-1, 0, 1, 1, 3]), np.array([0.3, 0.3, 0.3, 0.1, 0.1])))
    capsules = collision_capsules(tree, most=6)
    side = capsules.limb == 1
    assert side.sum() == 1
    assert_allclose(capsules.start[side], [[0, 1, 0]])
    assert_allclose(capsules.radius[side], 0.1 * ROOM)


def test_distance_is_to_the_nearest_surface() -> None:
    two = Capsules(
        np.array([[0.0, 0, 0], [5, 0, 0]]), np.array([[0.0, 2, 0], [5, 0, 0]]), np.array([0.5, 1.0]), np.array([0, 1])
    )
    points = np.array([[0, 1, 0], [1, 1, 0], [0, 3, 0], [5, 0, 2], [4.5, 0, 0]], float)
    assert_allclose(two.outside(points), [-0.5, 0.5, 0.5, 1, -0.5])


@pytest.mark.parametrize("most", [1, 2, 6, MOST])
def test_never_more_than_asked_for_and_the_trunk_always(most: int) -> None:
    tree = limb_tree(random_tree(800, rng=np.random.default_rng(2)))
    capsules = collision_capsules(tree, most)
    assert 1 <= len(capsules) <= most
    assert (capsules.limb == 0).any()
    assert np.all(np.diff(capsules.limb) >= 0)


def test_thick_wood_is_inside() -> None:
    skeleton = random_tree(800, rng=np.random.default_rng(2))
    tree = limb_tree(skeleton)
    mesh = GeneralisedCylinders()(skeleton, BARK)
    bound = bind_mesh(mesh.points, mesh.faces, tree.skeleton)
    is_thick = tree.skeleton.radius[bound.node] >= THICK * skeleton.radius[0]
    of_main = is_thick & (tree.limb_of_node[bound.node] == 0)
    outside = collision_capsules(tree).outside(mesh.points)
    assert of_main.sum() > 200
    assert np.mean(outside[of_main] <= 0) > 0.95
    assert outside[of_main].max() < GeneralisedCylinders().bow * tree_size(skeleton.position)  # the mesh's smoothing


def test_more_capsules_hold_less_air() -> None:
    bow = [[np.sin(a) * 3, 3 - np.cos(a) * 3, 0.0] for a in np.linspace(0, 1.5, 12)]
    tree = limb_tree(polyline(bow, np.linspace(0.3, 0.1, 12).tolist()))
    air = [volume(collision_capsules(tree, most)) for most in (1, 2, 4, 8)]
    assert np.all(np.diff(air) < 0)
    pieces = collision_capsules(tree, 8)
    assert_allclose(pieces.start[1:], pieces.end[:-1])  # one after another along the limb


def test_twigs_are_left_out_and_a_bud_has_one() -> None:
    thin = limb_tree(fork(side_radius=0.01))
    assert_array_equal(np.unique(collision_capsules(thin).limb), [0])
    bud = collision_capsules(limb_tree(polyline([[0, 0, 0]], 0.1)))
    assert bud.radius.min() > 0.1
