"""Growth over time: born in order, never shrinking, the finished tree at the end; fast loops equal plain ones."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.errors import InputError
from forestgen.tree.foliage_poses import quaternions
from forestgen.tree.growth import MODES, Anchors, Growth
from forestgen.tree.growth_age import birth_times, growth_age
from forestgen.tree.growth_binding import bind_mesh, limbs_of, rings_of
from forestgen.tree.growth_keys import gap, key_frames, leaf_error
from forestgen.tree.growth_leaves import blade, bound_leaves, opened, slerp
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Bark, Mesh
from forestgen.tree.skeleton import Skeleton, path_length
from tests.tree.plain_growth import plain_axis, plain_pose, printed_rotation
from tests.tree.skeletons import fork, polyline, random_tree

BARK = Bark(np.full((2, 2, 3), 90, np.uint8), width_m=0.4, height_m=0.8)
TREE = random_tree(400, rng=np.random.default_rng(3))
DOWN = np.array([0.0, -1.0, 0.0])


def mesh_of(skeleton: Skeleton) -> Mesh:
    return GeneralisedCylinders()(skeleton, BARK)


def test_growth_age_by_hand() -> None:
    #  2 m of trunk, the longest way; radius halves at the tip
    age = growth_age(polyline([[0, 0, 0], [0, 0.5, 0], [0, 2, 0]], [0.2, 0.2, 0.1]), thickness_weight=3.0)
    assert_allclose(age, [np.inf, 4 + 3 * 1.0, 1 + 3 * 0.5])


def test_thick_and_near_wood_is_born_first() -> None:
    skeleton = fork(side_radius=0.05)
    birth = birth_times(skeleton, 1.0, 0.5, 0.8)
    assert birth[0] == 0
    assert birth.max() == pytest.approx(0.8)
    assert np.all(birth[1:] > birth[skeleton.parent[1:]])
    #  of two nodes equally far out the thinner is the younger
    twin = replace(skeleton, radius=np.array([0.2] * 5 + [0.2] * 3))
    assert birth[7] > birth_times(twin, 1.0, 0.5, 0.8)[7]


@pytest.mark.parametrize("weight", [0.0, 1.0, 50.0])
def test_no_wood_appears_at_once(weight: float) -> None:
    growth = Growth(thickness_weight=weight)
    birth = growth(TREE).birth
    way = path_length(TREE.position, TREE.parent)
    speed = (way[1:] - way[TREE.parent[1:]]) / (birth[1:] - birth[TREE.parent[1:]])
    #  SLOWEST of the order, and the share of time that goes by order
    assert speed.max() <= way.max() / (0.5 * (1 - growth.wood_weight) * growth.last_birth) * (1 + 1e-9)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("tropism", [-25.0, 0.0, 20.0])
def test_nothing_shrinks_with_age_and_the_end_is_the_finished_tree(mode: str, tropism: float) -> None:
    tree = Growth(mode=mode, tropism_deg=tropism)(TREE)
    length, radius = np.zeros(len(TREE) - 1), np.zeros(len(TREE))
    for time in np.linspace(0.01, 1, 40):
        now = tree.at(float(time))
        step = np.linalg.norm(now.position[1:] - now.position[now.parent[1:]], axis=1)
        assert np.all(step >= length - 1e-6)  # m; places are float32
        assert np.all(now.radius >= radius - 1e-12)
        length, radius = step, now.radius
    assert_array_equal(now.position, TREE.position)
    assert_array_equal(now.radius, TREE.radius)
    nearly = tree.at(1 - 1e-9)
    assert_allclose(nearly.position, TREE.position, atol=1e-6)
    assert_allclose(nearly.radius, TREE.radius, atol=1e-6)


def test_without_order_the_whole_tree_is_scaled() -> None:
    tree = Growth(mode="scale", tropism_deg=0)(TREE)
    assert_allclose(tree.at(0.25).position, 0.25 * TREE.position, atol=1e-6)
    assert_allclose(tree.at(0.25).radius, 0.25 * TREE.radius)


def test_without_scaling_old_wood_stays_where_it_is() -> None:
    tree = Growth(mode="none", tropism_deg=0)(TREE)
    old = tree.birth < 0.5 - tree.growth.tapering
    assert 0 < np.count_nonzero(old) < len(TREE)
    now = tree.at(0.5)
    assert_allclose(now.position[old], TREE.position[old], atol=1e-6)
    assert_allclose(now.radius[old], TREE.radius[old])
    assert np.all(now.radius[tree.birth > 0.5] == 0)


def test_the_printed_rotation_lifts_with_a_positive_strength() -> None:
    rho = np.array([1.0, 0.0, 0.0])
    lifted = printed_rotation(np.cross(rho, DOWN), np.deg2rad(20)) @ rho
    assert_allclose(lifted, [np.cos(np.deg2rad(20)), np.sin(np.deg2rad(20)), 0], atol=1e-12)


@pytest.mark.parametrize("pieces", [1, 4, 40])
def test_a_level_branch_droops_by_the_strength_however_it_is_divided(pieces: int) -> None:
    along = np.linspace(0, 1, pieces + 1)[1:]
    position = np.concatenate([[[0, 0, 0], [0, 2, 0], [0, 4, 0]], [[x, 2, 0] for x in along]])
    parent = np.array([-1, 0, 1, 1, *range(3, 2 + pieces)])
    tree = Growth(tropism_deg=-10)(Skeleton(position, parent, np.full(len(parent), 0.1)))
    young = tree.pose(0.0).place
    end = young[-1] - (young[-2] if pieces > 1 else young[1])
    assert np.degrees(np.arctan2(end[1], end[0])) == pytest.approx(10, abs=0.35)  # the sine falls a little
    assert_allclose(young[2] / np.linalg.norm(young[2]), [0, 1, 0], atol=1e-12)  # upright wood does not bend


def test_posing_equals_plain_posing() -> None:
    tree = Growth(tropism_deg=17)(TREE)
    for time in (0.05, 0.4, 0.9):
        at = tree.pose(time, ahead=0.05)
        place, turn = plain_pose(TREE.position, TREE.parent, tree.birth, tree.bend, time, tree.size(time))
        assert_allclose(at.place, place, atol=1e-12)
        assert_allclose(at.turn, turn, atol=1e-12)


def test_carrying_equals_plain_carrying() -> None:
    rng = np.random.default_rng(1)
    tree = Growth(tropism_deg=-12)(TREE)
    anchors = Anchors(rng.integers(0, len(TREE), 300), rng.random(300), rng.normal(0, 0.1, (300, 3)))
    share = rng.random(300)
    for time in (0.05, 0.4, 0.9):
        at = tree.pose(time, ahead=0.03)
        axis = [
            plain_axis(TREE.parent, tree.birth, at.place, int(node), float(part), time + 0.03)
            for node, part in zip(anchors.node, anchors.part, strict=True)
        ]
        aside = np.einsum("vij,vj->vi", at.turn[anchors.node], anchors.offset) * share[:, None]
        assert_allclose(tree.carried(anchors, at, share), axis + aside, atol=2e-6)  # float32


def test_a_mesh_is_bound_limb_by_limb() -> None:
    mesh = mesh_of(TREE)
    tree = Growth()(TREE)
    anchors = bind_mesh(mesh.points, mesh.faces, TREE)
    back = tree.carried(anchors, tree.pose(1.0), np.ones(len(mesh.points)))
    assert_allclose(back, mesh.points, atol=1e-6)
    reach = np.linalg.norm(anchors.offset, axis=1) / TREE.radius[anchors.node]
    assert np.percentile(reach, 90) < 3  # dome, fillet and flare reach further
    limb = limbs_of(len(mesh.points), mesh.faces)
    for one in range(limb.max() + 1):  # all nodes of a limb lie on one way from the root
        node = set(anchors.node[limb == one].tolist())
        last = max(node)
        way = {last}
        while last > 0:
            last = int(TREE.parent[last])
            way.add(last)
        assert node <= way


def test_wood_without_thickness_has_no_area() -> None:
    mesh = mesh_of(TREE)
    tree = Growth(tropism_deg=-14)(TREE)
    anchors = bind_mesh(mesh.points, mesh.faces, TREE)
    thin = tree.carried(anchors, tree.pose(0.3, ahead=1.0), np.zeros(len(mesh.points))).astype(float)
    corner = thin[mesh.faces]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    assert area.max() < 1e-12  # m2: every triangle has two corners on one spot


def test_a_mesh_of_no_rings_is_bound_point_by_point() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    assert_array_equal(rings_of(points, np.array([0, 4])), [0, 1, 2, 3])
    tube = np.array(
        [[1, 0, 0], [0, 0, 1], [-1, 0, -1], [1, 0, 0], [1, 1, 0], [0, 1, 1], [-1, 1, -1], [1, 1, 0], [0, 2, 0]]
    )
    both = np.concatenate([tube, points + 5])
    assert_array_equal(rings_of(both.astype(float), np.array([0, 9, 13])), [0] * 4 + [1] * 4 + [2, 3, 4, 5, 6])


def test_twigs_that_cross_are_not_mistaken() -> None:
    #  two long arms from one trunk whose ends lie 1 cm apart
    position = [[0, 0, 0], [0, 1, 0], [0, 3, 0], [1, 2, 0], [2, 2, 0], [1, 2.01, 0.4], [2, 2.01, 0.01]]
    skeleton = Skeleton(np.array(position, float), np.array([-1, 0, 1, 1, 3, 2, 5]), np.full(7, 0.03))
    mesh = mesh_of(skeleton)
    anchors = bind_mesh(mesh.points, mesh.faces, skeleton)
    limb = limbs_of(len(mesh.points), mesh.faces)
    for one in range(limb.max() + 1):
        node = set(anchors.node[limb == one].tolist())
        assert not ({3, 4} & node and {5, 6} & node)


def test_leaves_bud_open_and_stay() -> None:
    rng = np.random.default_rng(2)
    tree = Growth(tropism_deg=-7)(TREE)
    turn = rng.normal(size=(50, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    foot = TREE.position[rng.integers(20, len(TREE), 50)] + rng.normal(0, 0.01, (50, 3))
    leaves = bound_leaves(tree, foot, turn, np.full((50, 3), 0.1))
    before = np.zeros((50, 3))
    for time in np.linspace(0.01, 1, 30):
        scale = leaves.scale_at(tree, float(time))
        assert np.all(scale >= before - 1e-9)
        assert np.all(scale[time <= leaves.wood.born] == 0)
        before = scale
    at = tree.pose(1.0)
    assert_allclose(before, 0.1, atol=1e-7)
    assert_allclose(leaves.position_at(tree, at), foot, atol=1e-6)
    end = leaves.orientation_at(tree, at)
    assert_allclose(np.abs(np.sum(end * turn, axis=1)), 1, atol=1e-9)
    node = leaves.anchors.node
    shoot = TREE.position[node] - TREE.position[TREE.parent[node]]
    assert_allclose(blade(leaves.bud), shoot / np.linalg.norm(shoot, axis=1, keepdims=True), atol=1e-6)


def test_quaternions() -> None:
    half = np.sqrt(0.5)
    quarter = np.array([[half, 0, half, 0]])  # about +Y
    matrix = np.array([[[0, 0, 1], [0, 1, 0], [-1, 0, 0]]], float)
    assert_allclose(quaternions(matrix), quarter, atol=1e-12)
    none = np.array([[1.0, 0, 0, 0]])
    eighth = [[np.cos(np.pi / 8), 0, np.sin(np.pi / 8), 0]]
    assert_allclose(slerp(none, quarter, np.array([0.5])), eighth)
    assert_allclose(slerp(-none, quarter, np.array([0.5])), eighth)  # the same turn, the shorter way


@pytest.mark.parametrize("mode", MODES)
def test_a_reader_between_key_samples_strays_less_than_stated(mode: str) -> None:
    frames, height = 120, float(np.ptp(TREE.position[:, 1]))
    tree = Growth(mode=mode, tropism_deg=-14)(TREE)
    keys, error = key_frames(tree, 0.1, frames, 0.01 * height, most=frames)
    assert keys[0] == 1
    assert keys[-1] == frames
    assert len(keys) < 40
    assert error <= 0.01 * height
    mesh = mesh_of(TREE)
    anchors = bind_mesh(mesh.points, mesh.faces, TREE)
    wood, ahead = tree.wood(anchors), gap(keys, frames)

    def points(frame: int) -> tuple[np.ndarray, np.ndarray]:
        at = tree.pose(frame / frames, ahead)
        share = tree.thickness(wood, at.time)
        return tree.carried(anchors, at, share), share

    for low, high in pairwise(keys.tolist()):
        (a, _), (b, thick) = points(low), points(high)
        seen = thick > 0  # where there is no wood at either key nothing is seen
        for frame in range(low + 1, high):
            line = a + (frame - low) / (high - low) * (b - a)
            off = np.linalg.norm(line - points(frame)[0], axis=1)[seen]
            assert off.max(initial=0) <= 2 * error + 1e-6  # vertices stand off the axis farther than a radius


def test_more_keys_stray_less_and_the_budget_is_kept() -> None:
    tree = Growth()(TREE)
    few, coarse = key_frames(tree, 0.1, 180, 1e-9, most=5)
    many, fine = key_frames(tree, 0.1, 180, 1e-9, most=40)
    assert (len(few), len(many)) == (5, 40)
    assert fine < coarse / 4
    times = np.arange(1, 181) / 180
    assert leaf_error(tree, times, times) == pytest.approx(0)


def test_frames_do_not_jump() -> None:
    frames = 180
    tree = Growth(tropism_deg=-25)(TREE)
    mesh = mesh_of(TREE)
    anchors = bind_mesh(mesh.points, mesh.faces, TREE)
    wood, before = tree.wood(anchors), None
    bound = 8 / frames * path_length(TREE.position, TREE.parent).max()
    for frame in range(1, frames + 1):
        at = tree.pose(frame / frames, 1 / frames)
        now = tree.carried(anchors, at, tree.thickness(wood, at.time))
        if before is not None:
            assert np.linalg.norm(now - before, axis=1).max() < bound
        before = now


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ({"mode": "fast"}, "mode: expected one of none, all, scale, came 'fast'"),
        ({"tropism_deg": 300.0}, "tropism: expected degrees between -60 and 60, came 300"),
        ({"tropism_deg": float("nan")}, "tropism: expected degrees"),
        ({"thickness_weight": -1.0}, "thickness_weight: expected 0 or more"),
    ],
)
def test_settings_beyond_sense_are_refused(setting: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        Growth(**setting)(TREE)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "skeleton",
    [
        polyline([[0, 0, 0]], 0.1),
        polyline([[1, 2, 3]] * 4, 0.1),
        polyline([[0, 0, 0], [0, 0, 0], [0, 1, 0]], 0.0),
        polyline([[0, 0, 0], [0, -1, 0]], [0.1, 0.4]),
    ],
    ids=["one node", "one spot", "a step of no length", "downward and thickening"],
)
def test_odd_skeletons_grow(skeleton: Skeleton) -> None:
    tree = Growth(tropism_deg=-20)(skeleton)
    for time in (0.01, 0.5, 1.0):
        now = tree.at(time)
        assert np.isfinite(now.position).all()
        assert np.isfinite(now.radius).all()
    mesh = mesh_of(skeleton)
    anchors = bind_mesh(mesh.points, mesh.faces, skeleton)
    back = tree.carried(anchors, tree.pose(1.0), np.ones(len(mesh.points)))
    assert_allclose(back, mesh.points, atol=1e-6)
    assert_array_equal(opened(tree, tree.birth, 1.0), 1)
