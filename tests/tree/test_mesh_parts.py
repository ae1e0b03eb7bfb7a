"""The pieces of the branch mesh: limbs, curves, frames, rings and fillets, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.frames import mitre_tangents, transport
from forestgen.tree.junctions import fillet, height_over, sockets
from forestgen.tree.limb_curves import LimbCurves, curve_through, relaxed
from forestgen.tree.limbs import Limbs, limbs_along, merge_coincident, plant, thickest_child, without_hairpins
from forestgen.tree.mesh import limb_radii
from forestgen.tree.rings import crossing_room, needed_stations
from forestgen.tree.root_flare import flared, remaining_flare
from forestgen.tree.skeleton import Skeleton
from tests.tree.skeletons import fork, polyline, random_tree

AWAY = np.array([0.0, 0.0, -1.0])


def curves_of(skeleton: Skeleton, bow: float = 0.01) -> LimbCurves:
    limbs = limbs_along(skeleton, thickest_child(skeleton))
    radius = limb_radii(limbs, skeleton.position, skeleton.radius, 1.0)
    return curve_through(
        limbs, skeleton.position[limbs.node], radius, np.zeros(len(limbs)), np.full(len(limbs.node), bow)
    )


def test_limbs_follow_the_thickest_child() -> None:
    #  2   4
    #   \ /
    #    1   3        radius of 4 > 2, and of 3 the least: limbs 0-1-4, 1-2, 0-3
    #     \ /
    #      0
    position = np.array([[0, 0, 0], [0, 1, 0], [-1, 2, 0], [1, 0.5, 0], [1, 2, 0]], float)
    skeleton = Skeleton(position, np.array([-1, 0, 1, 0, 1]), np.array([3.0, 3, 1, 0.5, 2]))
    limbs = limbs_along(skeleton, thickest_child(skeleton))
    runs = [limbs.node[a:b].tolist() for a, b in zip(limbs.first[:-1], limbs.first[1:], strict=True)]
    assert runs == [[0, 1, 4], [1, 2], [0, 3]]
    assert_array_equal(limbs.parent, [-1, 0, 0])
    assert_array_equal(limbs.socket, [-1, 1, 0])
    assert limbs.is_tip.all()


def test_of_equally_thick_children_the_straightest_continues() -> None:
    position = np.array([[0, 0, 0], [0, 1, 0], [1, 1.2, 0], [0.1, 2, 0], [-1, 1.5, 0]], float)
    skeleton = Skeleton(position, np.array([-1, 0, 1, 1, 1]), np.ones(5))
    assert thickest_child(skeleton)[1] == 3


def test_every_edge_of_a_tree_is_swept_once() -> None:
    skeleton = random_tree(500, rng=np.random.default_rng(0))
    limbs = limbs_along(skeleton, thickest_child(skeleton))
    follows = limbs.node[1:][limbs.has_next[:-1]]
    assert_array_equal(skeleton.parent[follows], limbs.node[:-1][limbs.has_next[:-1]])
    assert_array_equal(np.sort(follows), np.arange(1, 500))
    side = limbs.parent >= 0
    assert np.all(limbs.parent[side] < np.flatnonzero(side))
    assert_array_equal(limbs.node[limbs.socket[side]], limbs.node[limbs.first[:-1][side]])


def test_a_hairpin_ends_a_limb_but_noise_between_near_nodes_does_not() -> None:
    for gap, ends in ((1.0, True), (0.01, False)):
        skeleton = polyline([[0, 0, 0], [0, 1, 0], [0, 1 + gap, 0], [0.001, 1 + gap / 2, 0], [0, 3, 0]], 0.1)
        continues = without_hairpins(skeleton, thickest_child(skeleton))
        assert (continues[2] == -1) == ends


def test_coincident_nodes_hand_their_children_on() -> None:
    position = np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 1, 0], [1, 1, 0]], float)
    merged = merge_coincident(Skeleton(position, np.array([-1, 0, 1, 2, 1]), np.arange(5.0)))
    assert_array_equal(merged.parent, [-1, 0, 0])
    assert_array_equal(merged.radius, [0, 3, 4])


def test_planting_starts_the_trunk_under_the_root() -> None:
    planted = plant(fork(), 0.1)
    assert_allclose(planted.position[:2], [[0, -0.1, 0], [0, 0, 0]])
    assert_array_equal(planted.parent[:3], [-1, 0, 1])


def test_relaxing_irons_out_zigzag_within_its_limit() -> None:
    y = 0.02 * np.arange(100)
    skeleton = polyline([[0.01 * (-1) ** k, h, 0.0] for k, h in enumerate(y)], 0.1)
    continues = thickest_child(skeleton)
    position, radius = relaxed(skeleton, continues, np.full(100, 1.0))
    assert np.abs(position[5:-5, 0]).max() < 0.001
    assert_allclose(position[5:-5, 1], y[5:-5], atol=0.002)
    assert_allclose(radius, 0.1)
    position, _ = relaxed(skeleton, continues, np.full(100, 0.004))
    assert np.linalg.norm(position - skeleton.position, axis=1).max() <= 0.004 + 1e-12


def test_true_bends_between_distant_nodes_are_not_relaxed() -> None:
    skeleton = polyline([[0, 0, 0], [0, 1, 0], [0.5, 2, 0], [1.5, 2.5, 0]], 0.01)
    position, _ = relaxed(skeleton, thickest_child(skeleton), np.full(4, 1.0))
    assert np.linalg.norm(position - skeleton.position, axis=1).max() < 0.05


@pytest.mark.parametrize("bow", [0.001, 0.02])
def test_curves_pass_through_the_nodes_and_bow_no_further_than_told(bow: float) -> None:
    skeleton = random_tree(200, rng=np.random.default_rng(4))
    curves = curves_of(skeleton, bow)
    assert_allclose(curves.at(curves.knot_station), curves.position, atol=1e-9)
    knot = np.flatnonzero(curves.limbs.has_next)
    a, b = curves.position[knot], curves.position[knot + 1]
    ends = curves.knot_station[knot], curves.knot_station[knot + 1]
    for share in np.linspace(0, 1, 21):
        point = curves.at(ends[0] + share * (ends[1] - ends[0]))
        t = np.clip(np.sum((point - a) * (b - a), axis=1) / np.sum((b - a) ** 2, axis=1), 0, 1)
        assert np.linalg.norm(point - a - t[:, None] * (b - a), axis=1).max() <= 1.3 * bow


def test_frames_do_not_twist() -> None:
    a = np.linspace(0, 1.5 * np.pi, 40)
    arc = np.column_stack([np.cos(a), np.sin(a), 0 * a])  # plane: the binormal or normal stays +-Z
    first = np.array([0, 40])
    tangent = mitre_tangents(arc, first)
    normal = transport(arc, tangent, first, AWAY)
    assert_allclose(normal, np.broadcast_to(AWAY, (40, 3)), atol=1e-12)
    assert_allclose(np.sum(normal * tangent, axis=1), 0, atol=1e-12)


def test_a_frame_around_a_helix_turns_by_its_torsion() -> None:
    a = np.linspace(0, 4 * np.pi, 2000)
    pitch = 0.5
    helix = np.column_stack([np.cos(a), np.sin(a), pitch * a])
    first = np.array([0, len(a)])
    tangent = mitre_tangents(helix, first)
    normal = transport(helix, tangent, first, AWAY)
    inward = -np.column_stack([np.cos(a), np.sin(a), 0 * a])
    angle = np.unwrap(np.arctan2(np.sum(np.cross(inward, normal) * tangent, 1), np.sum(inward * normal, 1)))
    length = np.hypot(1, pitch) * (a[-1] - a[0])
    torsion = pitch / (1 + pitch**2)
    assert angle[-1] - angle[0] == pytest.approx(-torsion * length, rel=2e-3)


def test_curves_swept_together_are_as_if_swept_alone() -> None:
    rng = np.random.default_rng(0)
    parts = [np.cumsum(rng.normal(0, 0.3, (n, 3)) + np.eye(3)[1], axis=0) for n in (2, 9, 5)]
    first = np.array([0, 2, 11, 16])
    together = transport(np.concatenate(parts), mitre_tangents(np.concatenate(parts), first), first, AWAY)
    for k, part in enumerate(parts):
        alone = np.array([0, len(part)])
        assert_allclose(together[first[k] : first[k + 1]], transport(part, mitre_tangents(part, alone), alone, AWAY))


def test_rings_keep_the_axis_within_tolerance_with_no_more_than_needed() -> None:
    a = np.linspace(0, np.pi / 2, 12)
    skeleton = polyline([[np.cos(t) - 1, np.sin(t), 0.0] for t in a], 0.01)
    curves = curves_of(skeleton, bow=1.0)
    for tolerance in (0.02, 0.005):
        station, _ = needed_stations(curves, np.full(12, tolerance), np.full(12, 100.0))
        ring = curves.at(station)
        middle = (ring[1:] + ring[:-1]) / 2 + [1, 0, 0]
        sag = 1 - np.linalg.norm(middle, axis=1)
        assert sag.max() < 1.4 * tolerance  # the first and last half step know no bend
        assert len(station) <= np.ceil(np.pi / 2 / np.sqrt(8 * tolerance)) + 2


def test_crossing_room_by_hand() -> None:
    # two planes at 90 degrees, each ring 1 m before the other's plane: both may be 1 m wide
    centre = np.array([[0.0, 0, 0], [1, 1, 0]])
    tangent = np.array([[np.cos(0.1), np.sin(0.1), 0], [np.sin(0.1), np.cos(0.1), 0]])
    distance = np.cos(0.1) + np.sin(0.1)
    sine = np.cos(0.1) ** 2 - np.sin(0.1) ** 2
    assert_allclose(crossing_room(centre, tangent, np.array([0, 2])), distance / sine)
    assert np.isinf(crossing_room(centre, tangent, np.array([0, 1, 2]))).all()


def test_a_side_branch_starts_as_thick_as_itself() -> None:
    skeleton = fork(side_radius=0.05)
    limbs = limbs_along(skeleton, thickest_child(skeleton))
    radius = limb_radii(limbs, skeleton.position, skeleton.radius, 0.35)
    side = radius[limbs.first[1] :]
    assert_allclose(side[:-1], 0.05)
    assert side[-1] == pytest.approx(0.35 * 0.05)
    equal = fork(side_radius=0.2, angle_deg=90)
    limbs = limbs_along(equal, thickest_child(equal))
    assert limb_radii(limbs, equal.position, equal.radius, 1.0)[limbs.first[1]] == pytest.approx(0.92 * 0.2)


def fork_socket() -> tuple[Limbs, LimbCurves]:
    curves = curves_of(fork(angle_deg=90))
    return curves.limbs, curves


def test_height_over_the_parent_by_hand() -> None:
    _, curves = fork_socket()
    here = sockets(curves, np.array([1]), 0.8)
    points = np.array([[0.5, 2, 0], [0, 2.1, 0.2], [0.1, 1.9, 0]])
    height, normal = height_over(here, np.zeros(3, int), points)
    assert_allclose(height, [0.3, 0, -0.1], atol=1e-9)
    assert_allclose(normal, [[1, 0, 0], [0, 0, 1], [1, 0, 0]], atol=1e-9)


def test_a_fillet_is_a_ball_rolled_along_both() -> None:
    _, curves = fork_socket()
    here = sockets(curves, np.array([1]), 0.8)  # the side branch: radius 0.1, along +X at y = 2; ball 0.08
    x = np.array([0.2, 0.2 + 0.04, 0.2 + 0.08, 0.6])
    points = np.column_stack([x, np.full(4, 2.1), np.zeros(4)])
    moved = fillet(here, np.zeros(4, int), points, np.broadcast_to([0.0, 1.0, 0.0], (4, 3)))
    assert_allclose(moved[:, 1] - 2.1, [0.08, 0.08 * (1 - np.sqrt(0.75)), 0, 0], atol=1e-9)
    assert_allclose(moved[:, 0], x)


def test_flare_is_whole_at_the_ground_and_gone_above() -> None:
    angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    assert flared(np.zeros(200), angle, 0.2, 0.4).mean() == pytest.approx(1.4)
    assert flared(np.zeros(200), angle, 0.2, 0.4).min() > 1.0
    assert_allclose(flared(np.full(200, 1.0), angle, 0.2, 0.4), 1, atol=0.002)
    assert remaining_flare(0.4, 0.2, 0.2) == pytest.approx(0.4)
    assert remaining_flare(0.4, 0.28, 0.2) == pytest.approx(0.0)
