"""Wind data says where and how easily limbs bend, and swaying by it tears nothing."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from forestgen.tree.limb_tree import limb_tree, nearest_unit
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Atlas, Bark, Leaves, TreeModel
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.sway import Gust, blown, rotations, sway, turns
from forestgen.tree.wind import GOLDEN, STEPS, Wind, limb_of_leaves, limb_of_mesh, stiffness, wind_of
from tests.tree.skeletons import fork, polyline, random_tree

BARK = Bark(np.full((1, 1, 3), 90, np.uint8), 0.3, 0.3)
STORM = Gust(time=1.7, direction=0.4, strength=0.4)


def leaves_at(foot: NDArray[np.float64]) -> Leaves:
    """Leaves (K,) with their feet at (K, 3), not turned."""
    n = len(foot)
    return Leaves(foot, np.tile([1.0, 0, 0, 0], (n, 1)), np.full(n, 0.1), np.zeros(n, np.int64))


def model_of(skeleton: Skeleton, leaves: Leaves) -> TreeModel:
    """A tree of a skeleton with leaves of no particular look."""
    from tests.usd.models import leaf_prototype

    atlas = Atlas(np.zeros((1, 1, 4), np.uint8), (leaf_prototype(0, 1),))
    mesh = GeneralisedCylinders()(skeleton, BARK)
    return TreeModel("t", "tan2008", 1, 4.0, (), skeleton, mesh, BARK, atlas, leaves)


@pytest.fixture(scope="module")
def twiggy() -> TreeModel:
    """A tree of 600 nodes with a leaf at each."""
    skeleton = random_tree(600, rng=np.random.default_rng(3))
    return model_of(skeleton, leaves_at(skeleton.position[30:]))


def test_a_fork_turns_where_the_side_branch_comes_out_of_the_trunk() -> None:
    #   4
    #   3   7       the trunk is 0.2 m thick, so that its branch shows from 0.2 m of its way on
    #   2 5 6
    #   1
    #   0
    wind = wind_of(limb_tree(fork(angle_deg=50.0)))
    ahead = np.array([np.sin(np.deg2rad(50)), np.cos(np.deg2rad(50)), 0])
    assert_array_equal(wind.parent, [-1, 0])
    assert_array_equal(wind.level, [0, 1])
    assert_allclose(wind.pivot, [[0, 0, 0], [0, 2, 0] + 0.2 * ahead], atol=1e-12)
    assert_allclose(wind.axis, [[0, 4, 0], 1.3 * ahead], atol=1e-12)
    assert_allclose(wind.phase, [0, GOLDEN], atol=0.5 / STEPS)
    assert_allclose(wind.stiffness, stiffness(np.array([0.2, 0.1]), np.array([4.0, 1.5])), atol=0.5 / STEPS)


def test_stiffness_is_a_beams() -> None:
    #           as agreed, twice as long, the same beam, thicker, without thickness
    radius = np.array([0.01, 0.01, 0.02, 0.02, 0.0])
    length = np.array([1.0, 2.0, 2 ** (4 / 3), 1.0, 1.0])
    half, long, same, thick, none = stiffness(radius, length)
    assert_allclose([half, same], 0.5)
    assert_allclose(long, 1 / (1 + np.sqrt(8)))
    assert_allclose(thick, 1 / (1 + np.sqrt(1 / 16)))
    assert 0 <= none < 1e-6


def test_a_limb_bends_like_a_cantilever() -> None:
    wind = wind_of(limb_tree(polyline([[0, 0, 0], [0, 2, 0], [0, 4, 0]], 0.1)))
    height = np.array([-0.3, 0, 1, 2, 3, 4, 4.2])
    points = np.column_stack([0.1 * np.ones(7), height, np.zeros(7)])
    share = wind.bend(points, np.zeros(7, np.int64))
    assert_allclose(share[[0, 1, 3, 5, 6]], [0, 0, 0.5 * (6 - 2 + 0.25) / 3, 1, 1])
    assert np.all(np.diff(share[1:6]) > 0)


def test_neighbours_do_not_swing_together() -> None:
    up = [[0.0, y, 0.0] for y in range(12)]
    sides = [[1.0, y + 0.5, 0.0] for y in range(1, 11)]
    position = np.array(up + sides)
    parent = np.array([*range(-1, 11), *range(1, 11)])
    wind = wind_of(limb_tree(Skeleton(position, parent, np.array([0.2] * 12 + [0.05] * 10))))
    gap = np.abs(np.diff(wind.phase[1:]))
    assert len(gap) == 9
    assert_allclose(np.minimum(gap, 1 - gap), 1 - GOLDEN, atol=1.01 / STEPS)
    # the same tree, its side branches told in another order
    turned = wind_of(
        limb_tree(
            Skeleton(
                position[[*range(12), *range(21, 11, -1)]],
                np.array([*range(-1, 11), *range(10, 0, -1)]),
                np.array([0.2] * 12 + [0.05] * 10),
            )
        )
    )
    assert_allclose(turned.phase[1:], wind.phase[:0:-1])


def test_points_and_leaves_know_their_limb() -> None:
    skeleton = fork(angle_deg=90.0)
    tree = limb_tree(skeleton)
    mesh = GeneralisedCylinders()(skeleton, BARK)
    limb = limb_of_mesh(mesh, tree)
    is_side = mesh.points[:, 0] > 0.5
    assert is_side.sum() > 10
    assert_array_equal(limb[is_side], 1)
    assert_array_equal(limb[np.abs(mesh.points[:, 1] - 2) > 0.5], 0)
    assert_array_equal(
        limb_of_leaves(leaves_at(np.array([[0.3, 3.5, 0], [1.2, 2.1, 0.1], [0, 4, 0]])), tree), [0, 1, 0]
    )


def test_the_nearest_wood_is_between_nodes() -> None:
    node, part = nearest_unit(np.array([[0.3, 2.75, 0], [5.0, 2.0, 0], [0, 0.1, 0]]), fork(angle_deg=90.0))
    assert_array_equal(node, [3, 7, 1])
    assert_allclose(part, [0.75, 1, 0.1])


def test_a_root_alone_and_coincident_nodes_are_trees_too() -> None:
    alone = wind_of(limb_tree(polyline([[0, 0, 0]], 0.1)))
    assert_allclose(alone.axis, [[0, 0.1, 0]])
    doubled = wind_of(limb_tree(polyline([[0, 0, 0], [0, 1, 0], [0, 1, 0], [0, 2, 0]], 0.1)))
    assert_allclose(doubled.axis, [[0, 2, 0]])
    with pytest.raises(ValueError, match="run the radius stage first"):
        limb_tree(polyline([[0, 0, 0], [0, 1, 0]], np.nan))


def test_no_wind_moves_nothing(twiggy: TreeModel) -> None:
    still = sway(twiggy, wind_of(limb_tree(twiggy.skeleton)), Gust(time=3.0, strength=0.0))
    assert_allclose(still.mesh.points, twiggy.mesh.points, atol=1e-12)
    assert_allclose(still.leaves.position, twiggy.leaves.position, atol=1e-12)
    assert_allclose(still.leaves.orientation, twiggy.leaves.orientation, atol=1e-12)


def test_it_bends_with_the_wind_from_the_root_to_the_tips(twiggy: TreeModel) -> None:
    wind = wind_of(limb_tree(twiggy.skeleton))
    points = twiggy.mesh.points
    moved = sway(twiggy, wind, STORM).mesh.points - points
    far = np.linalg.norm(moved, axis=1)
    size = np.ptp(points, axis=0).max()
    assert far[points[:, 1] <= 0].max() < 1e-4 * size  # the flare's far side stands a little above the leaning ground
    along = moved @ [np.cos(0.4), 0, -np.sin(0.4)]
    assert along.mean() > 0.02 * size
    tree = limb_tree(twiggy.skeleton)
    joints = np.concatenate([tree.limbs.first[:-1], tree.limbs.first[1:] - 1]).reshape(2, -1)  # bases and tips
    at = tree.skeleton.position[tree.limbs.node[joints]]
    reach = [np.linalg.norm(blown(wind, np.arange(len(wind)), end, STORM)[0] - end, axis=1) for end in at]
    assert len(wind) > 50
    assert np.mean(reach[1] > reach[0]) > 0.8  # a limb's own swing may go against its parent's
    assert np.median(reach[1]) > 1.05 * np.median(reach[0])
    trunk = np.array([[0.0, y, 0.0] for y in (0.0, 1.0, 2.0, 4.0, 5.7)])
    sways = np.linalg.norm(blown(wind, np.zeros(5, np.int64), trunk, STORM)[0] - trunk, axis=1)
    assert sways[0] == 0
    assert np.all(np.diff(sways, n=2) > 0)  # a stem bends ever more on its way up


def test_nothing_tears(twiggy: TreeModel) -> None:
    """Where limbs meet they are carried alike, and no edge of the mesh is stretched by much."""
    tree = limb_tree(twiggy.skeleton)
    wind = wind_of(tree)
    side = np.flatnonzero(wind.parent >= 0)
    below, _ = blown(wind, wind.parent[side], wind.pivot[side], STORM)
    above, _ = blown(wind, side, wind.pivot[side], STORM)
    assert_allclose(above, below, atol=1e-12)
    faces = twiggy.mesh.faces
    edge = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    points, moved = twiggy.mesh.points, sway(twiggy, wind, STORM).mesh.points
    before = np.linalg.norm(points[edge[:, 0]] - points[edge[:, 1]], axis=1)
    after = np.linalg.norm(moved[edge[:, 0]] - moved[edge[:, 1]], axis=1)
    assert np.abs(after - before).max() < 0.01 * np.ptp(points[:, 1])


def test_leaves_stay_on_their_wood(twiggy: TreeModel) -> None:
    tree = limb_tree(twiggy.skeleton)
    wind = wind_of(tree)
    leaves = sway(twiggy, wind, STORM).leaves
    limb = limb_of_leaves(twiggy.leaves, tree)
    foot, turned = blown(wind, limb, twiggy.leaves.position, STORM)
    assert_allclose(leaves.position, foot)
    tip, _ = blown(wind, limb, twiggy.leaves.position + np.array([0, 1e-6, 0]), STORM)
    w, x, y, z = leaves.orientation.T  # the blade's +Y goes where the wood's does
    blade = np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], axis=1)
    assert_allclose(blade, turned[:, :, 1], atol=1e-9)
    assert_allclose((tip - foot) / 1e-6, blade, atol=0.9)  # bending adds to turning, but not much
    n = np.einsum("li,li->l", (tip - foot) / 1e-6, blade)
    assert np.median(n) > 0.99


def test_rotations_are_rodrigues() -> None:
    quarter = rotations(np.array([[0, 0, np.pi / 2], [0, 0, 0], [0, 1e-9, 0]]))
    assert_allclose(quarter[0] @ [1, 0, 0], [0, 1, 0], atol=1e-12)
    assert_allclose(quarter[1:], np.tile(np.eye(3), (2, 1, 1)), atol=1e-8)


def test_a_limb_leans_where_the_wind_blows() -> None:
    wind = Wind(np.zeros((1, 3)), np.array([[0, 2.0, 0]]), np.array([0]), np.zeros(1), np.zeros(1), np.array([-1]))
    for direction, ahead in ((0.0, [1, 0, 0]), (np.pi / 2, [0, 0, -1])):
        turn = turns(wind, Gust(time=0.0, direction=direction, strength=0.5))
        assert_allclose(rotations(turn)[0] @ [0, 1, 0] @ np.array(ahead), np.sin(0.5 * 0.6))


def test_the_same_skeleton_gives_the_same_wind(twiggy: TreeModel) -> None:
    first, second = (wind_of(limb_tree(twiggy.skeleton)) for _ in range(2))
    for name in ("pivot", "axis", "level", "phase", "stiffness", "parent"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()
        assert not getattr(first, name).flags.writeable
