"""The parts of leaf placement: samples, footprints, wood that hides, poses, stations, colours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.camera import Camera
from forestgen.tree.foliage_colour import colours_at, facing, foliage_colours, nearest_prototype
from forestgen.tree.foliage_fill import open_seeds
from forestgen.tree.foliage_fit import Placement, Target, blade_samples, draw_wood, footprint, make_target
from forestgen.tree.foliage_poses import frames, normals_across, quaternions
from forestgen.tree.foliage_twigs import (
    YoungWood,
    crowding,
    place_stations,
    spread_from_above,
    young_wood,
)
from forestgen.tree.foliage_unmixing import pure_foliage
from forestgen.tree.model import Atlas, LeafPrototype, Leaves
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View
from tests.tree.foliage.crown import grow, rotation


def square(colour: tuple[float, float, float] = (0.2, 0.5, 0.1)) -> LeafPrototype:
    """A flat leaf, one long and a half wide, the lower half of a white texture."""
    points = np.array([[-0.25, 0, 0], [0.25, 0, 0], [0.25, 1, 0], [-0.25, 1, 0]], float)
    normals = np.tile([0.0, 0.0, 1.0], (4, 1))
    uv = points[:, :2] * [1, 0.5] + [0.5, 0]
    return LeafPrototype(points, normals, uv, np.array([[0, 1, 2], [0, 2, 3]]), np.array(colour), 10.0)


def test_samples_lie_evenly_on_the_opaque_part() -> None:
    rgba = np.full((10, 10, 4), 255, np.uint8)
    rgba[7:, :, 3] = 0  # the lower 60 % of the leaf's half of the texture
    samples = blade_samples(Atlas(rgba, (square(),)), 64)
    assert samples.shape == (1, 64, 3)
    assert samples[0, :, 1].min() >= 0.6 - 1e-9
    assert samples[0, :, 1].mean() == pytest.approx(0.8, abs=0.05)
    assert samples[0, :, 0].mean() == pytest.approx(0.0, abs=0.05)


def test_footprint_equals_projection_point_by_point(view: View) -> None:
    """The affine short cut against the camera itself; with a focal length it is off by less than a pixel."""
    rng = np.random.default_rng(0)
    atlas = Atlas(np.full((4, 4, 4), 255, np.uint8), (square(),))
    samples = blade_samples(atlas, 30)
    axis = rng.normal(size=(20, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    normal = normals_across(axis, rng.normal(size=(20, 3)))
    place = rng.uniform([-1, 3, -1], [1, 5, 1], (20, 3))
    leaves = Placement(place, frames(axis, normal), np.full(20, 0.1), np.zeros(20, np.int64))
    blank = np.full(view.mattes.foliage.shape, -np.inf, np.float32)
    for focal, tolerance in ((None, 0), (2000.0, 1)):
        target = Target(
            replace(view, camera=replace(view.camera, focal_px=focal)),
            view.mattes.is_foliage,
            blank > 0,
            blank,
            blank > 0,
        )
        found = footprint(target, leaves, samples)
        for k in range(20):
            points = place[k] + 0.1 * samples[0] @ leaves.rotation[k].T
            xy = np.floor(target.view.camera.project(points)).astype(int)
            width = blank.shape[1]
            off = np.abs(np.column_stack([found.pixel[k] % width, found.pixel[k] // width]) - xy)
            assert off.max() <= tolerance
            if focal is None:
                assert found.inside[k] == pytest.approx(target.is_foliage[xy[:, 1], xy[:, 0]].mean())


def test_wood_hides_what_is_behind_it(view: View) -> None:
    atlas = Atlas(np.full((4, 4, 4), 255, np.uint8), (square(),))
    samples = blade_samples(atlas, 30)
    pole = Skeleton(np.array([[0, 0, 0], [0, 5, 0.0]]), np.array([-1, 0]), np.array([0.3, 0.3]))
    target = make_target(view, pole)
    flat = frames(np.array([[0.0, 1, 0]] * 2), np.array([[0.0, 0, 1]] * 2))
    place = np.array([[0, 1.0, -1.0], [0, 1.0, 1.0]])
    found = footprint(target, Placement(place, flat, np.full(2, 0.1), np.zeros(2, np.int64)), samples)
    assert found.inside.tolist() == [1.0, 0.0]  # the trunk shows there: behind it yes, before it no
    assert (found.pixel[0] == -1).all()
    assert (found.pixel[1] >= 0).all()


def test_leaves_hide_wood_that_the_photo_does_not_show(skeleton: Skeleton, view: View, atlas: Atlas) -> None:
    """Without the rounds aimed at it more of the grown wood is bare; what is visible in the photo is never aimed at."""

    def bare_wood(leaves: Leaves) -> float:
        target = make_target(view, skeleton)
        placed = Placement(leaves.position, rotation(leaves.orientation), leaves.size, leaves.prototype)
        pixel = footprint(target, placed, blade_samples(atlas, 96)).pixel
        covered = np.zeros(target.is_grown.size, bool)
        covered[pixel[pixel >= 0]] = True
        return float((target.is_grown.ravel() & ~covered).sum() / target.is_grown.sum())

    target = make_target(view, skeleton)
    assert not (target.is_grown & view.mattes.is_branch & ~view.mattes.is_foliage).any()
    assert bare_wood(grow(skeleton, view, atlas)) < 0.85 * bare_wood(grow(skeleton, view, atlas, fill_rounds=0))


def test_wood_is_drawn_from_the_far_to_the_near(view: View) -> None:
    cross = Skeleton(
        np.array([[0, 1, 0], [0, 2, 0], [-1, 1.5, 0.5], [1, 1.5, 0.5]]), np.array([-1, 0, 0, 2]), np.full(4, 0.1)
    )
    depth = draw_wood(view, cross)
    column, row = np.floor(view.camera.project(np.array([[0, 1.5, 0], [0.0, 1.9, 0]]))).astype(int).T
    assert_allclose(depth[row, column], [0.6, 0.1], atol=1e-6)
    assert np.isneginf(depth[0, 0])


def test_quaternions_turn_as_their_matrices() -> None:
    rng = np.random.default_rng(0)
    axis = rng.normal(size=(200, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    matrix = frames(axis, normals_across(axis, rng.normal(size=(200, 3))))
    half_turns = np.array([np.diag(d) for d in ([1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1])], float)
    matrix = np.concatenate([matrix, half_turns])
    assert_allclose(np.linalg.det(matrix), 1)
    assert_allclose(rotation(quaternions(matrix)), matrix, atol=1e-12)


def test_stations_follow_the_golden_angle() -> None:
    pole = Skeleton(np.array([[0, 0, 0], [0, 10.0, 0]]), np.array([-1, 0]), np.array([0.02, 0.02]))
    wood = young_wood(pole)
    turn = np.deg2rad(137.5)
    stations = place_stations(wood, 40, turn, 1, 0.0, rng=np.random.default_rng(0))
    assert len(stations) in (40, 41)
    assert (np.diff(stations.position[:, 1]) > -1e-9).all()
    angle = np.unwrap(np.arctan2(stations.outward[:, 0], stations.outward[:, 2]))
    assert_allclose(np.abs(np.mod(np.diff(angle) + np.pi, 2 * np.pi) - np.pi), turn, atol=1e-6)
    assert_allclose(np.linalg.norm(stations.position[:, [0, 2]], axis=1), 0.018)
    pairs = place_stations(wood, 40, np.pi / 2, 2, 0.0, rng=np.random.default_rng(0))
    assert_allclose(pairs.outward[0::2], -pairs.outward[1::2], atol=1e-12)


def test_branches_are_named_by_their_farthest_tip() -> None:
    #  3     a fork whose left arm is longer
    #  2 4
    #   1
    #   0
    position = np.array([[0, 0, 0], [0, 1, 0], [-1, 2, 0], [-1, 3, 0], [0.5, 1.5, 0]], float)
    slender = Skeleton(position, np.array([-1, 0, 1, 2, 1]), np.array([1, 0.01, 0.01, 0.01, 0.01]))
    assert young_wood(slender).branch.tolist() == [3, 3, 3, 4]


def test_crowding_counts_the_wood_of_a_cell() -> None:
    points = np.array([[0.1, 0.1, 0.1], [0.2, 0.1, 0.1], [5.0, 0, 0]])
    assert crowding(points, np.array([1.0, 2.0, 4.0]), 1.0).tolist() == [3, 3, 4]


def test_old_wood_bears_no_leaf(skeleton: Skeleton) -> None:
    wood = young_wood(skeleton)
    assert (wood.end[:, 1] > 2.0).all()
    assert len(wood) > 0
    assert len(young_wood(Skeleton(np.zeros((1, 3)), np.array([-1]), np.array([0.1])))) == 0


def test_open_seeds_give_one_pixel_a_cell() -> None:
    is_open = np.zeros((8, 8), bool)
    is_open[0:2, 0:2] = True  # four pixels of one cell
    is_open[6, 6] = True  # a lone pixel is not worth a leaf
    seeds = open_seeds(is_open, 4.0, rng=np.random.default_rng(0))
    assert seeds.shape == (1, 2)
    assert (seeds < 2).all()


def test_colour_of_foliage_only(view: View) -> None:
    colours = foliage_colours(view, pure_foliage(view), 4.0)
    height, width = view.mattes.foliage.shape
    points = view.camera.unproject(np.array([[width * 0.2, height * 0.25], [width * 0.85, height * 0.3]]))
    lab = colours_at([view], [colours], points, facing([view], points))
    assert lab[0, 1] < 0 < lab[1, 1]  # green, red: the sky's blue is not in it


def test_nearest_prototype_without_chance() -> None:
    lab = np.array([[50, 0, 0], [20, 0, 0], [50, 40, 0]], float)
    wish = np.array([[48, 2, 0], [22, 0, 0], [50, 30, 0]], float)
    among = np.ones((3, 3), bool)
    rng = np.random.default_rng(0)
    assert nearest_prototype(wish, lab, among, 0.0, rng=rng).tolist() == [0, 1, 2]
    among[0, 0] = False
    assert nearest_prototype(wish, lab, among, 0.0, rng=rng)[0] == 1


def test_a_flat_crown_spreads_wider_than_the_photo_shows_it() -> None:
    def wood_at(places: np.ndarray) -> YoungWood:
        n = len(places)
        return YoungWood(places - 0.01, places + 0.01, np.ones(n), np.ones(n), np.ones(n), np.arange(n))

    grid = np.stack(np.meshgrid(np.arange(8), np.arange(8)), axis=-1).reshape(-1, 2) + 0.5
    table = np.column_stack([grid[:, 0], np.full(64, 5.5), grid[:, 1]])  # 8 x 8 m, a cell high
    wall = np.column_stack([grid, np.full(64, 0.5)])  # the same, seen face on
    front, side = (Camera((10, 10), (0.0, 0.0), 1.0, azimuth) for azimuth in (0.0, np.pi / 2))
    assert spread_from_above(wood_at(table), [front], 1.0) == 8
    assert spread_from_above(wood_at(wall), [front], 1.0) == 1
    assert spread_from_above(wood_at(wall), [side], 1.0) == 1  # a line from the side, a line from above
    assert spread_from_above(wood_at(np.vstack([table, wall])), [front], 1.0) == 64 / 64
