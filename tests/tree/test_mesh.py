"""The branch mesh: closed, outward, where the skeleton is, and sound for any skeleton."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Bark, Mesh
from forestgen.tree.skeleton import Skeleton
from tests.tree.skeletons import fork, polyline, random_tree

BARK = Bark(np.full((2, 2, 3), 90, np.uint8), width_m=0.4, height_m=0.8)
PLAIN = GeneralisedCylinders(flare=0.0, roughness=0.0, tip=1.0)  # true cylinders, for measures
ONE = polyline([[0, 0, 0]], 0.1)
ZIGZAG = polyline([[0.08 * (k % 2), 0.05 * k, 0.0] for k in range(60)], 0.25)
HAIRPIN = polyline([[0, 0, 0], [0, 2, 0], [0.01, 0.2, 0], [0.02, 2.2, 0.0]], 0.1)
SPIRAL = polyline([[0.1 * np.cos(a), 0.02 * a, 0.1 * np.sin(a)] for a in np.arange(0, 14, 0.5)], 0.09)
AWKWARD = {
    "one node": ONE,
    "one node without thickness": polyline([[0, 0, 0]], 0.0),
    "two nodes": polyline([[0, 0, 0], [0, 1, 0]], 0.1),
    "all nodes on one spot": polyline([[1, 2, 3]] * 5, 0.1),
    "zero-length steps": polyline([[0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 1, 0], [0.1, 2, 0], [0.1, 2, 0]], 0.1),
    "no thickness": polyline([[0, 0, 0], [0, 1, 0], [0.2, 2, 0]], 0.0),
    "thicker than long": polyline([[0, 0, 0], [0, 0.1, 0], [0.05, 0.2, 0]], 2.0),
    "downward": polyline([[0, 0, 0], [0, -1, 0], [0, -2, 0.1]], 0.1),
    "needle-sharp turns": HAIRPIN,
    "zigzag wider than thick": polyline([[0.3 * (k % 2), 0.05 * k, 0.0] for k in range(30)], 0.1),
    "zigzag finer than thick": ZIGZAG,
    "spiral as wide as thick": SPIRAL,
    "all branches from the root": Skeleton(
        np.array([[0, 0, 0], [0, 1, 0], [1, 0.5, 0], [-1, 0.5, 0.3]]), np.array([-1, 0, 0, 0]), np.full(4, 0.1)
    ),
    "a child thicker than its parent": Skeleton(
        np.array([[0, 0, 0], [0, 1, 0], [0, 2, 0], [1, 1.5, 0]]),
        np.array([-1, 0, 1, 1]),
        np.array([0.1, 0.1, 0.3, 0.2]),
    ),
}


def limbs_of(mesh: Mesh) -> list[trimesh.Trimesh]:
    """The connected parts of a mesh, seams welded."""
    whole = trimesh.Trimesh(mesh.points, mesh.faces, process=False)
    whole.merge_vertices(merge_tex=True, merge_norm=True)
    return list(whole.split(only_watertight=False))


def assert_sound(mesh: Mesh) -> None:
    assert len(mesh.faces)
    for array in (mesh.points, mesh.normals, mesh.uv):
        assert np.isfinite(array).all()
    assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-9)
    for limb in limbs_of(mesh):
        assert limb.is_watertight
        assert limb.is_winding_consistent
        assert limb.volume > 0


def distance_to(points: NDArray[np.float64], skeleton: Skeleton) -> NDArray[np.float64]:
    """Distance (Q,) m from points (Q, 3) to the nearest straight piece of the skeleton."""
    a, b = skeleton.position[skeleton.parent[1:]], skeleton.position[1:]
    chord = b - a
    t = np.einsum("qsk,sk->qs", points[:, None] - a, chord) / np.maximum(np.sum(chord**2, axis=1), 1e-300)
    foot = a + np.clip(t, 0, 1)[..., None] * chord
    return np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1)


@pytest.mark.parametrize("skeleton", AWKWARD.values(), ids=AWKWARD.keys())
def test_any_skeleton_gives_a_closed_outward_surface(skeleton: Skeleton) -> None:
    assert_sound(GeneralisedCylinders()(skeleton, BARK))


@pytest.mark.parametrize("seed", range(4))
def test_random_trees_are_closed_limb_by_limb(seed: int) -> None:
    assert_sound(GeneralisedCylinders()(random_tree(600, rng=np.random.default_rng(seed)), BARK))


def test_a_straight_branch_is_a_cylinder_with_the_right_volume() -> None:
    mesh = PLAIN(polyline([[0, 0, 0], [0, 2, 0], [0, 5, 0]], 0.1), BARK)
    (limb,) = limbs_of(mesh)
    n = np.count_nonzero(np.isclose(mesh.points[:, 1], mesh.points[:, 1].min())) - 1
    section = n / 2 * np.sin(2 * np.pi / n) * 0.1**2  # a polygon of n sides
    assert limb.volume == pytest.approx(section * (5 + 0.035 + 0.1), rel=0.01)  # trunk, in the ground, end
    radial = np.linalg.norm(mesh.points[mesh.points[:, 1] < 4.999][:, [0, 2]], axis=1)
    assert_allclose(radial, 0.1, atol=1e-12)


def test_the_surface_lies_one_radius_from_the_skeleton() -> None:
    skeleton = random_tree(400, rng=np.random.default_rng(5))
    mesh = PLAIN(skeleton, BARK)
    size = np.linalg.norm(np.ptp(skeleton.position, axis=0))
    above = mesh.points[mesh.points[:, 1] > 0]
    # a curve may bow by 0.1 % of the size and half a radius, fillets add less than a radius
    assert distance_to(above, skeleton).max() < 0.002 * size + 2.5 * skeleton.radius.max()
    thin = GeneralisedCylinders(flare=0.0, roughness=0.0)(
        Skeleton(skeleton.position, skeleton.parent, np.full(400, 1e-3)), BARK
    )
    assert distance_to(thin.points[thin.points[:, 1] > 0], skeleton).max() < 0.0011 * size + 3e-3


def test_every_node_is_wrapped_in_wood() -> None:
    skeleton = random_tree(300, rng=np.random.default_rng(2))
    mesh = GeneralisedCylinders()(skeleton, BARK)
    size = np.linalg.norm(np.ptp(skeleton.position, axis=0))
    gap = np.linalg.norm(mesh.points[None] - skeleton.position[:, None], axis=2).min(axis=1)
    along = 60 * skeleton.radius  # rings on straight twigs stand far apart
    assert np.all(gap < along + 0.002 * size)


def test_normals_point_out_of_the_wood() -> None:
    mesh = GeneralisedCylinders(flare=0.0, roughness=0.0, tip=1.0)(fork(), BARK)
    a, b, c = (mesh.points[mesh.faces[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
    smooth = mesh.normals[mesh.faces].mean(axis=1)
    x, y, z = mesh.points[mesh.faces].mean(axis=1).T
    is_hidden = (np.hypot(x, z) < 0.195) & (y < 4)  # of the side branch, inside the trunk
    agree = np.sum(flat * smooth, axis=1)[~is_hidden & (y > 0)]
    assert np.all(agree > 0)
    assert np.mean(agree > 0.8) > 0.97


def test_no_ring_pierces_its_neighbour_in_tight_bends() -> None:
    # where rings cross, flats turn inside out and wrap space backwards: a winding number below 0
    for skeleton in (ZIGZAG, SPIRAL, polyline([[0, 0, 0], [0, 1, 0], [0.7, 1.3, 0], [1.4, 0.9, 0]], 0.2)):
        mesh = GeneralisedCylinders(flare=0.0, roughness=0.0)(skeleton, BARK)
        (limb,) = limbs_of(mesh)
        outside = limb.triangles_center + 1e-4 * limb.face_normals
        assert winding_number(limb, outside).min() > -0.05


def winding_number(surface: trimesh.Trimesh, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How often a closed surface wraps around points (Q,): 1 inside, 0 outside, by solid angles."""
    a, b, c = (surface.triangles[None, :, k] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    volume = np.sum(a * np.cross(b, c), axis=2)
    flat = la * lb * lc + np.sum(a * b, 2) * lc + np.sum(b * c, 2) * la + np.sum(c * a, 2) * lb
    return np.asarray(np.arctan2(volume, flat).sum(axis=1) / (2 * np.pi))


@pytest.mark.parametrize("angle_deg", [20, 50, 90, 130])
@pytest.mark.parametrize("side_radius", [0.02, 0.1, 0.19])
def test_a_side_branch_starts_inside_its_parent(angle_deg: float, side_radius: float) -> None:
    mesh = GeneralisedCylinders(flare=0.0, roughness=0.0)(fork(side_radius=side_radius, angle_deg=angle_deg), BARK)
    stem, side = limbs_of(mesh)
    first = np.argsort(np.linalg.norm(side.vertices - [0, 2, 0], axis=1))[:3]
    assert_allclose(winding_number(stem, side.vertices[first]), 1, atol=0.05)
    crossing = winding_number(stem, side.vertices)
    assert (crossing > 0.5).any()  # inside, where nobody sees it
    assert (crossing < 0.5).any()  # and out


def test_a_fillet_widens_the_branch_at_its_parent_and_nowhere_else() -> None:
    def width_at(collar: float, x: float) -> float:
        mesh = GeneralisedCylinders(flare=0.0, roughness=0.0, collar=collar)(fork(angle_deg=90), BARK)
        side = limbs_of(mesh)[1]
        outline = side.section(plane_origin=[x, 0, 0], plane_normal=[1, 0, 0]).vertices
        return float(np.ptp(outline[:, 1]))

    assert width_at(0.8, 0.21) > width_at(1e-6, 0.21) + 0.05
    assert width_at(0.8, 0.75) == pytest.approx(width_at(1e-6, 0.75), abs=0.005)


def test_uv_goes_a_whole_number_of_times_around_and_is_not_stretched() -> None:
    mesh = PLAIN(polyline([[0, 0, 0], [0, 2, 0], [0, 6, 0]], 0.2), BARK)
    low = np.flatnonzero(np.isclose(mesh.points[:, 1], mesh.points[:, 1].min()))
    around = np.ptp(mesh.uv[low, 0])
    assert around == round(2 * np.pi * 0.2 / BARK.width_m)
    first_on_ring = (mesh.uv[:, 0] == mesh.uv[low, 0].min()) & (mesh.points[:, 1] < 6)
    assert first_on_ring.sum() >= 3
    y, v = mesh.points[first_on_ring, 1], mesh.uv[first_on_ring, 1]
    rate = np.diff(v) / np.diff(y)
    assert_allclose(rate, around / (2 * np.pi * 0.2) * BARK.width_m / BARK.height_m, rtol=1e-6)


def test_v_goes_on_from_the_parent_to_its_side_branch() -> None:
    mesh = PLAIN(fork(), BARK)
    start = np.linalg.norm(mesh.points - [0, 2, 0], axis=1)
    side = mesh.points[:, 0] > 0.25
    stem_v = np.interp(2.0, mesh.points[~side, 1], mesh.uv[~side, 1])
    assert mesh.uv[side, 1].min() > stem_v
    assert mesh.uv[side & (start < 0.6), 1].min() < stem_v + 0.6 / BARK.height_m * 2


def test_the_trunk_widens_into_the_ground_around_the_root() -> None:
    skeleton = polyline([[0, 0.3 * k, 0] for k in range(10)], 0.2)
    mesh = GeneralisedCylinders(tip=1.0, flare=0.4, sink=0.35)(skeleton, BARK)
    assert mesh.points[:, 1].min() == pytest.approx(-0.35 * 0.2)

    def mean_radius(y: float) -> float:
        near = np.abs(mesh.points[:, 1] - y) < 0.16
        return float(np.linalg.norm(mesh.points[near][:, [0, 2]], axis=1).mean())

    assert 1.15 * 0.2 < mean_radius(0.0) < 1.6 * 0.2
    assert mean_radius(1.2) == pytest.approx(0.2, rel=0.08)
    foot = mesh.points[np.abs(mesh.points[:, 1]) < 0.01]
    assert_allclose(foot[:, [0, 2]].mean(axis=0), 0, atol=0.03)


def test_a_skeleton_that_widens_itself_is_not_flared_twice() -> None:
    radius = [0.3, 0.27, 0.24, 0.21, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2]
    mesh = GeneralisedCylinders(roughness=0.0)(polyline([[0, 0.2 * k, 0] for k in range(10)], radius), BARK)
    foot = mesh.points[np.abs(mesh.points[:, 1]) < 0.01]
    assert np.linalg.norm(foot[:, [0, 2]], axis=1).max() < 0.34


def test_thick_limbs_have_more_sides_than_twigs() -> None:
    def sides(radius: float) -> int:
        mesh = PLAIN(polyline([[0, 0, 0], [0, 10, 0]], radius), BARK)
        return int(np.count_nonzero(np.isclose(mesh.points[:, 1], mesh.points[:, 1].min()))) - 1

    assert [sides(r) for r in (0.003, 0.02, 0.5)] == sorted(sides(r) for r in (0.003, 0.02, 0.5))
    assert sides(0.003) == 3
    assert sides(0.5) == 18


def test_a_straight_twig_costs_no_more_for_being_finely_traced() -> None:
    coarse = PLAIN(polyline([[0, 0, 0], [0, 5, 0]], 0.01), BARK)
    fine = PLAIN(polyline([[0, 0.05 * k, 0] for k in range(101)], 0.01), BARK)
    assert len(fine.faces) <= 1.2 * len(coarse.faces)


def test_the_same_skeleton_gives_the_same_bytes_and_is_left_alone() -> None:
    skeleton = random_tree(300, rng=np.random.default_rng(1))
    before = skeleton.position.copy()
    a, b = (GeneralisedCylinders()(skeleton, BARK) for _ in range(2))
    for name in ("points", "normals", "uv", "faces"):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes()
    assert_array_equal(skeleton.position, before)


def test_scaling_a_tree_scales_its_mesh() -> None:
    skeleton = random_tree(200, rng=np.random.default_rng(3))
    large = Skeleton(skeleton.position * 7, skeleton.parent, skeleton.radius * 7)
    a, b = (GeneralisedCylinders()(s, BARK) for s in (skeleton, large))
    assert_allclose(a.points * 7, b.points, atol=1e-6)


@pytest.mark.parametrize("bad", [np.nan, -0.1])
def test_unknown_or_negative_radii_are_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="radius"):
        GeneralisedCylinders()(polyline([[0, 0, 0], [0, 1, 0]], [0.1, bad]), BARK)


@pytest.mark.parametrize("tree", ["oak_summer", "oak_winter", "pine_medium"])
def test_true_trees_are_closed_and_their_wood_covers_the_true_branches(shared: Path, tree: str) -> None:
    skeleton = true_skeleton(shared / "ground_truth" / tree / "skeleton.json")
    mesh = GeneralisedCylinders()(skeleton, BARK)
    assert_sound(mesh)
    assert len(mesh.faces) < 180_000


def true_skeleton(path: Path) -> Skeleton:
    """The true branches of a tree, each hung on the nearest node laid before."""
    position: list[list[float]] = []
    parent: list[int] = []
    radius: list[float] = []
    for branch in json.loads(path.read_text())["branches"]:
        points = branch["xyz"]
        begin = min(len(position), 1)
        node = int(np.argmin(np.linalg.norm(np.array(position) - points[0], axis=1))) if begin else -1
        for k in range(begin, len(points)):
            position.append(points[k])
            parent.append(node)
            radius.append(branch["radius"][k])
            node = len(position) - 1
    return Skeleton(np.array(position), np.array(parent), np.array(radius))
