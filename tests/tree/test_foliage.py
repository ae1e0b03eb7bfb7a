"""Leaves: on young wood, inside the foliage, facing the light, in the colours of their places."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.tree.atlas import LeafAtlasFromPhoto
from forestgen.tree.foliage import LeavesAlongBranches
from forestgen.tree.foliage_colour import colours_at, facing, foliage_colours, nearest_prototype, prototype_lab
from forestgen.tree.foliage_fill import open_seeds
from forestgen.tree.foliage_fit import Placement, Target, blade_samples, draw_wood, footprint, make_target
from forestgen.tree.foliage_poses import frames, normals_across, quaternions
from forestgen.tree.foliage_twigs import crowding, last_tip, place_stations, young_wood
from forestgen.tree.foliage_unmixing import pure_foliage
from forestgen.tree.leaf_scale import leaf_length
from forestgen.tree.mattes import Mattes
from forestgen.tree.model import Atlas, LeafPrototype, Leaves
from forestgen.tree.photo import Photo
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View
from tests.synthetic import DrawnTree, drawn_tree


def twiggy(skeleton: Skeleton, per_node: int = 60, reach: float = 0.5) -> Skeleton:
    """The drawn tree with thin twigs around its tips, thrown as its leaf discs are."""
    rng = np.random.default_rng(1)
    tips = np.setdiff1d(np.arange(len(skeleton)), skeleton.parent)
    position, parent = [skeleton.position], [skeleton.parent]
    end = np.repeat(skeleton.position[tips], per_node, axis=0) + rng.normal(0, reach / 1.7, (len(tips) * per_node, 3))
    start = np.repeat(tips, per_node)
    for share in (0.33, 0.66, 1.0):
        n = sum(map(len, position))
        position.append(skeleton.position[np.repeat(tips, per_node)] * (1 - share) + end * share)
        parent.append(start)
        start = n + np.arange(len(end))
    radius = np.concatenate([skeleton.radius, np.full(3 * len(end), 0.006)])
    return Skeleton(np.concatenate(position), np.concatenate(parent), radius)


@pytest.fixture(scope="module")
def tree() -> DrawnTree:
    return drawn_tree(px_per_metre=120.0)


@pytest.fixture(scope="module")
def view(tree: DrawnTree) -> View:
    """Leaves are green on the left half of the crown and red on the right."""
    rgb = tree.photo.rgb.copy()
    right = tree.mattes.is_foliage & (np.arange(rgb.shape[1]) > tree.camera.root_px[0])
    rgb[right] = (170, 60, 40)
    return replace(tree.view, photo=Photo(rgb, "half.png"))


@pytest.fixture(scope="module")
def skeleton(tree: DrawnTree) -> Skeleton:
    return twiggy(tree.skeleton)


@pytest.fixture(scope="module")
def atlas(view: View) -> Atlas:
    return LeafAtlasFromPhoto()([view], rng=np.random.default_rng(0))


@pytest.fixture(scope="module")
def leaves(skeleton: Skeleton, view: View, atlas: Atlas) -> Leaves:
    return grow(skeleton, view, atlas)


def grow(skeleton: Skeleton, view: View, atlas: Atlas, seed: int = 0, **fields: object) -> Leaves:
    strategy = LeavesAlongBranches(**fields)  # type: ignore[arg-type]
    return strategy(skeleton, [view], atlas, rng=np.random.default_rng(seed))


def rotation(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrices (L, 3, 3) of unit quaternions w x y z, by turning the axes: q v q*."""
    w, v = quaternion[:, :1], quaternion[:, 1:]
    columns = []
    for axis in np.eye(3):
        t = 2 * np.cross(v, axis)
        columns.append(axis + w * t + np.cross(v, t))
    return np.stack(columns, axis=2)


def drawn(leaves: Leaves, view: View, atlas: Atlas) -> NDArray[np.bool_]:
    """What leaves cover in the photo: every triangle of every leaf, filled, its texture's holes ignored."""
    mask = np.zeros(view.mattes.foliage.shape, np.uint8)
    turn = rotation(leaves.orientation) * leaves.size[:, None, None]
    for k, prototype in enumerate(atlas.prototypes):
        for m, p in zip(turn[leaves.prototype == k], leaves.position[leaves.prototype == k], strict=True):
            xy = view.camera.project(prototype.points @ m.T + p) - 0.5
            for face in prototype.faces:
                cv2.fillPoly(mask, [np.round(xy[face] * 16).astype(np.int32)], 1, shift=4)
    return mask > 0


def test_leaves_cover_the_foliage_and_nothing_else(
    leaves: Leaves, skeleton: Skeleton, view: View, atlas: Atlas
) -> None:
    cover, foliage = drawn(leaves, view, atlas), view.mattes.is_foliage
    shared = (cover & foliage).sum()
    assert shared / foliage.sum() > 0.85
    bare = cover & ~foliage & ~view.mattes.is_branch & ~make_target(view, skeleton).is_grown
    assert bare.sum() / cover.sum() < 0.2  # polygons are drawn, 0.88 of whose opaque part is inside


def test_every_leaf_is_inside(leaves: Leaves, skeleton: Skeleton, view: View, atlas: Atlas) -> None:
    """Plain: leaf after leaf, point after point, through the camera itself."""
    target = make_target(view, skeleton)
    samples = blade_samples(atlas, 50)
    turn = rotation(leaves.orientation)
    for k in range(0, len(leaves), 37):
        points = leaves.position[k] + leaves.size[k] * samples[leaves.prototype[k]] @ turn[k].T
        column, row = np.floor(view.camera.project(points)).astype(int).T
        far = view.camera.depth(points)
        good = target.is_foliage[row, column] | (far < target.wood_depth[row, column])
        assert good.mean() >= 0.88 - 0.1  # other sample points than the strategy's


def test_petioles_stand_on_young_wood(leaves: Leaves, skeleton: Skeleton) -> None:
    wood = young_wood(skeleton)
    t = np.linspace(0, 1, 21)[:, None, None]
    on_axis = ((1 - t) * wood.start + t * wood.end).reshape(-1, 3)
    radius = np.tile(wood.radius, 21)
    for foot in leaves.position[::29]:
        gap = np.linalg.norm(on_axis - foot, axis=1) - radius
        assert gap.min() < 0.02
    assert wood.radius.max() <= 0.2 * skeleton.radius.max()


def test_leaves_clothe_all_sides(leaves: Leaves, skeleton: Skeleton) -> None:
    """Depth is spread as the twigs are, so the crown is no sheet."""
    wood = young_wood(skeleton)
    middle = (wood.start + wood.end) / 2
    assert np.std(leaves.position[:, 2]) > 0.75 * np.std(middle[:, 2])
    assert abs(np.mean(leaves.position[:, 2]) - np.mean(middle[:, 2])) < 0.3 * np.std(middle[:, 2])


def test_visible_wood_stays_visible(skeleton: Skeleton, view: View, atlas: Atlas, leaves: Leaves) -> None:
    """In front of the trunk's pixels there is no leaf; behind them leaves may be."""
    target = make_target(view, skeleton)
    samples = blade_samples(atlas, 40)
    placed = Placement(leaves.position, rotation(leaves.orientation), leaves.size, leaves.prototype)
    pixel = footprint(target, placed, samples).pixel
    flat = pixel[pixel >= 0]
    wood = view.mattes.is_branch & ~view.mattes.is_foliage
    assert wood.ravel()[np.unique(flat)].sum() < 0.12 * wood.sum()


def test_colours_come_back_from_the_front(leaves: Leaves, view: View, atlas: Atlas) -> None:
    red = prototype_lab(atlas)[leaves.prototype, 1] > 10
    middle = view.camera.project(leaves.position)[:, 0]
    away = np.abs(middle - view.camera.root_px[0]) > 0.3 * view.camera.px_per_metre
    assert (red == (middle > view.camera.root_px[0]))[away].mean() > 0.97


def test_same_seed_same_bytes(leaves: Leaves, skeleton: Skeleton, view: View, atlas: Atlas) -> None:
    again, other = grow(skeleton, view, atlas), grow(skeleton, view, atlas, seed=1)
    for name in ("position", "orientation", "size", "prototype"):
        assert getattr(again, name).tobytes() == getattr(leaves, name).tobytes()
    assert other.position.tobytes() != leaves.position.tobytes()


def test_sizes_vary_about_the_matte_rule(leaves: Leaves, view: View) -> None:
    usual = leaf_length([view])
    assert 0.25 * usual < leaves.size.min() < leaves.size.max() <= 2.0 * usual
    assert np.std(leaves.size) > 0.1 * usual


def test_the_paper_sizes_and_numbers_leaves_by_trunk_and_branch(skeleton: Skeleton, view: View, atlas: Atlas) -> None:
    paper = {"size_rule": "trunk", "number_rule": "branch", "fill_rounds": 0, "tries": 1, "size_spread": 0.0}
    leaves = grow(skeleton, view, atlas, inside=0.0, **paper)
    assert_allclose(leaves.size, 0.1 * skeleton.radius.max())
    branches = len(np.unique(young_wood(skeleton).branch))
    assert 50 * branches <= 1.05 * len(leaves) <= 1.1 * 200 * branches
    kept = grow(skeleton, view, atlas, **paper)
    assert len(kept) < len(leaves)


def test_no_more_leaves_than_allowed(skeleton: Skeleton, view: View, atlas: Atlas) -> None:
    assert len(grow(skeleton, view, atlas, most=100)) <= 115  # the number of a station is rounded by chance


def test_a_bare_tree_bears_no_leaf(skeleton: Skeleton, atlas: Atlas) -> None:
    bare = drawn_tree(leaves=False).view
    empty = LeafAtlasFromPhoto()([bare], rng=np.random.default_rng(0))
    assert len(grow(skeleton, bare, empty)) == 0
    assert len(grow(skeleton, bare, atlas)) == 0


def test_every_view_is_heeded(skeleton: Skeleton, view: View, atlas: Atlas) -> None:
    """With a second view that shows foliage above one line only, no leaf stands below it."""
    camera = Camera(view.camera.size, view.camera.root_px, view.camera.px_per_metre, azimuth=np.pi / 2)
    line = int(camera.project(np.array([[0.0, 4.2, 0.0]]))[0, 1])
    foliage = np.zeros_like(view.mattes.foliage)
    foliage[:line] = 1
    side = replace(view, mattes=Mattes(foliage, np.zeros_like(foliage)), camera=camera)
    leaves = LeavesAlongBranches()(skeleton, [view, side], atlas, rng=np.random.default_rng(0))
    assert len(leaves) > 100
    xy = camera.project(leaves.position)
    wood = np.isfinite(draw_wood(side, skeleton)).astype(np.uint8)
    near_wood = cv2.dilate(wood, np.ones((25, 25), np.uint8)) > 0
    column, row = np.floor(xy[xy[:, 1] > line + 0.1 * camera.px_per_metre]).astype(int).T
    assert near_wood[row, column].all()  # it hides them


def test_fields_are_checked() -> None:
    with pytest.raises(ValueError, match="per_node is 0; expected at least 1"):
        LeavesAlongBranches(per_node=0)
    with pytest.raises(ValueError, match="inside is 2; expected a share"):
        LeavesAlongBranches(inside=2)


# --- parts -----------------------------------------------------------------------------------------


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
    assert last_tip(position, np.array([-1, 0, 1, 2, 1])).tolist() == [3, 3, 3, 3, 4]


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
