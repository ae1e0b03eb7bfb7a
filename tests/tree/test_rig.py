"""The rig: few joints where the limbs bend, shares that add up, and skinning that tears nothing."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from forestgen.tree.limb_tree import limb_tree
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.rig import Rig, Skin, joint_turns, rig_of, skin_of_leaves, skin_of_mesh
from forestgen.tree.sway import PERIOD, Gust
from tests.tree.skeletons import fork, polyline, random_tree
from tests.tree.test_wind import BARK, leaves_at

STORM = Gust(time=2.0, strength=0.4)


def posed(rig: Rig, turn: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation (J, 3, 3) and shift (J, 3) that each joint gives a point at rest, from turns (J, 3, 3) of the joints."""
    rotation, shift = np.empty((len(rig), 3, 3)), np.empty((len(rig), 3))
    for j, above in enumerate(rig.parent.tolist()):
        stay = rig.position[j] - turn[j] @ rig.position[j]
        rotation[j], shift[j] = turn[j], stay
        if above >= 0:
            rotation[j] = rotation[above] @ turn[j]
            shift[j] = rotation[above] @ stay + shift[above]
    return rotation, shift


def skinned(rig: Rig, skin: Skin, points: NDArray[np.float64], turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Plain linear blend skinning of points (P, 3)."""
    rotation, shift = posed(rig, turn)
    each = np.einsum("pkij,pj->pki", rotation[skin.joint], points) + shift[skin.joint]
    return np.asarray(np.einsum("pk,pki->pi", skin.weight, each))


@pytest.fixture(scope="module")
def rig() -> Rig:
    return rig_of(limb_tree(random_tree(600, rng=np.random.default_rng(3))))


def test_the_longest_stiff_piece_gets_the_next_joint() -> None:
    tree = limb_tree(fork(angle_deg=50.0))  # a trunk of 4 m, a side branch of 1.5 m
    assert_array_equal(rig_of(tree, 1).limb, [0])
    three = rig_of(tree, 3)
    assert_array_equal(three.limb, [0, 0, 1])
    assert_allclose(three.position, [[0, 0, 0], [0, 2, 0], three.wind.pivot[1]])
    assert_array_equal(three.parent, [-1, 0, 1])
    four = rig_of(tree, 4)
    assert_array_equal(four.limb, [0, 0, 0, 1])
    assert_allclose(four.position[:3], [[0, 0, 0], [0, 4 / 3, 0], [0, 8 / 3, 0]])
    assert_array_equal(four.parent, [-1, 0, 1, 1])  # the side branch leaves the trunk's second bone
    assert_allclose(four.frame[:, :, 1][0], [0, 1, 0])


@pytest.mark.parametrize("most", [1, 5, 128, 10_000])
def test_never_more_joints_than_asked_for(most: int) -> None:
    rig = rig_of(limb_tree(random_tree(200, rng=np.random.default_rng(1))), most)
    assert len(rig) <= most
    assert np.all(rig.parent[1:] < np.arange(1, len(rig)))
    assert_allclose(np.einsum("jki,jkl->jil", rig.frame, rig.frame), np.tile(np.eye(3), (len(rig), 1, 1)), atol=1e-12)
    assert_allclose(np.linalg.det(rig.frame), 1)


def test_no_joints_are_no_rig() -> None:
    with pytest.raises(ValueError, match="at least 1 joint"):
        rig_of(limb_tree(fork()), 0)


def test_shares_add_up_and_blend_over_a_joint() -> None:
    rig = rig_of(limb_tree(polyline([[0, 0, 0], [0, 1, 0], [0, 2, 0], [0, 4, 0]], 0.1)), 2)
    height = np.array([0.0, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0])
    skin = skin_of_leaves(rig, leaves_at(np.column_stack([np.zeros(7), height, np.zeros(7)])))
    upper = np.sum(skin.weight * (skin.joint == 1), axis=1)
    assert_allclose(upper, [0, 0, 0, 0.5, 1, 1, 1])  # from a quarter of a bone below to one above
    assert_allclose(skin.weight.sum(axis=1), 1, atol=1e-15)


def test_every_point_has_its_joints(rig: Rig) -> None:
    mesh = GeneralisedCylinders()(rig.tree.skeleton, BARK)
    skin = skin_of_mesh(rig, mesh)
    assert skin.weight.min() >= 0
    assert_allclose(skin.weight.sum(axis=1), 1, atol=1e-15)
    assert_array_equal(np.unique(skin.joint), np.arange(len(rig)))
    assert_array_equal(skin.joint[mesh.points[:, 1] < 0.05 * np.ptp(mesh.points[:, 1]), 0], 0)


def test_a_turned_joint_moves_its_limb_and_what_stands_on_it_only(rig: Rig) -> None:
    mesh = GeneralisedCylinders()(rig.tree.skeleton, BARK)
    skin = skin_of_mesh(rig, mesh)
    joint = int(np.flatnonzero(rig.place == 0)[3])
    below = np.zeros(len(rig), bool)
    below[joint] = True
    for j, above in enumerate(rig.parent.tolist()):
        below[j] |= above >= 0 and below[above]
    turn = np.tile(np.eye(3), (len(rig), 1, 1))
    turn[joint] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    far = np.linalg.norm(skinned(rig, skin, mesh.points, turn) - mesh.points, axis=1)
    share = np.sum(skin.weight * below[skin.joint], axis=1)
    assert far[share == 0].max() < 1e-12
    assert np.all(far[share > 0.9] > 0)
    assert (share > 0.9).sum() > 10


def test_swaying_tears_nothing(rig: Rig) -> None:
    mesh = GeneralisedCylinders()(rig.tree.skeleton, BARK)
    moved = skinned(rig, skin_of_mesh(rig, mesh), mesh.points, joint_turns(rig, STORM))
    edge = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    before, after = (np.linalg.norm(p[edge[:, 0]] - p[edge[:, 1]], axis=1) for p in (mesh.points, moved))
    size = np.ptp(mesh.points[:, 1])
    assert np.linalg.norm(moved - mesh.points, axis=1).max() > 0.05 * size
    assert np.abs(after - before).max() < 0.015 * size
    still = skinned(rig, skin_of_mesh(rig, mesh), mesh.points, joint_turns(rig, Gust(2.0, strength=0.0)))
    assert_allclose(still, mesh.points, atol=1e-12)


def test_the_sway_repeats(rig: Rig) -> None:
    first, last = (joint_turns(rig, Gust(time)) for time in (0.7, 0.7 + PERIOD))
    assert_allclose(first, last, atol=1e-9)
    assert np.abs(first - joint_turns(rig, Gust(0.7 + PERIOD / 3))).max() > 0.01
