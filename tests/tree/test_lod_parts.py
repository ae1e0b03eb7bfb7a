"""The parts of levels of detail, on cases small enough to be checked by eye."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.limbs import limbs_along, thickest_child
from forestgen.tree.lod_leaves import leaf_order, turned
from forestgen.tree.lod_order import bit_reversed, morton
from forestgen.tree.lod_outline import OUTLINE_WEIGHT, depth_below_outline, outline_weight, without_small_holes
from forestgen.tree.lod_prototypes import covered_area, face_areas, simpler
from forestgen.tree.lod_wood import limb_sizes, polygon_width, thickening, thinned_out
from forestgen.tree.skeleton import Skeleton
from tests.tree.lod_trees import blade_atlas, bushy_tree
from tests.tree.skeletons import fork


def test_bit_reversal_by_hand() -> None:
    assert_array_equal(bit_reversed(8), np.array([0, 4, 2, 6, 1, 5, 3, 7]) / 8)
    assert_array_equal(bit_reversed(1), [0])


@pytest.mark.parametrize("share", [0.1, 0.25, 0.6])
def test_any_stretch_of_the_order_is_thinned_out_alike(share: float) -> None:
    kept = bit_reversed(4000) < share
    for first in range(0, 4000, 500):
        assert kept[first : first + 500].mean() == pytest.approx(share, abs=0.02)


def test_the_curve_visits_the_corners_of_a_cube_in_turn() -> None:
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    assert_array_equal(morton(corners, 1.0), np.arange(8))
    assert_array_equal(morton(corners, 0.0), np.zeros(8))
    assert_array_equal(morton(np.zeros((3, 3)), 5.0), np.zeros(3))


def test_leaves_are_left_out_evenly_in_space_and_shade_and_late_where_they_weigh_more() -> None:
    rng = np.random.default_rng(0)
    position, shade = rng.uniform(0, 1, (6400, 3)), rng.uniform(0, 1, 6400)
    weight = np.where(position[:, 0] > 0.5, 4.0, 1.0)
    order = leaf_order(position, shade, weight)
    assert_array_equal(np.sort(order.order), np.arange(6400))
    stays = np.zeros(6400, bool)
    stays[order.order[: np.searchsorted(order.due, 0.2)]] = True
    heavy = position[:, 0] > 0.5
    assert stays[heavy].mean() == pytest.approx(0.8, abs=0.01)
    assert stays[~heavy].mean() == pytest.approx(0.2, abs=0.01)
    for low in np.arange(4) / 4:
        for axis in (1, 2):
            slab = heavy & (position[:, axis] >= low) & (position[:, axis] < low + 0.25)
            assert stays[slab].mean() == pytest.approx(0.8, abs=0.03)
        tone = ~heavy & (shade >= low) & (shade < low + 0.25)
        assert stays[tone].mean() == pytest.approx(0.2, abs=0.03)


def test_turning_by_a_quaternion_by_hand() -> None:
    quarter = np.sqrt(0.5) * np.array([[1.0, 0, 0, 1], [1.0, 1, 0, 0]])  # about z, about x
    assert_allclose(turned(quarter, np.array([[1.0, 0, 0], [0, 1, 0]])), [[0, 1, 0], [0, 0, 1]], atol=1e-12)


def test_points_of_a_ball_are_as_deep_as_they_lie_inside() -> None:
    rng = np.random.default_rng(1)
    way = rng.normal(size=(60_000, 3))
    far = 0.5 * np.minimum(rng.uniform(size=60_000) * 1.5, 1) ** (1 / 3)  # a third on the surface
    points = way / np.linalg.norm(way, axis=1, keepdims=True) * far[:, None]
    depth = depth_below_outline(points)
    # no silhouette shows a point less deep than it is, and the dozen sides leave little over
    assert np.all(depth >= 0.5 - far - 0.02)
    level = np.abs(points[:, 1]) < 0.1
    assert np.all(depth[level] <= 0.5 - 0.9 * far[level] + 0.02)
    weight = outline_weight(points)
    assert weight.max() == OUTLINE_WEIGHT
    assert np.all(weight[far < 0.4] == 1)


def test_only_large_holes_have_an_outline() -> None:
    mask = np.ones((40, 40), bool)
    mask[5:7, 5:7] = mask[20:30, 20:30] = False  # 4 and 100 cells of 1600
    expected = np.ones((40, 40), bool)
    expected[20:30, 20:30] = False
    assert_array_equal(without_small_holes(mask), expected)


def test_depth_of_no_point_and_of_one() -> None:
    assert depth_below_outline(np.zeros((0, 3))).shape == (0,)
    assert outline_weight(np.ones((1, 3))) == OUTLINE_WEIGHT


@pytest.mark.parametrize("triangles", [2, 4, 8])
def test_a_simpler_leaf_lies_where_the_leaf_lies_and_shows_what_it_shows(triangles: int) -> None:
    atlas = blade_atlas()
    for leaf in atlas.prototypes:
        strip = simpler(leaf, triangles)
        assert len(strip.faces) == triangles
        assert np.all(strip.uv >= leaf.uv.min(axis=0) - 1e-9)
        assert np.all(strip.uv <= leaf.uv.max(axis=0) + 1e-9)
        assert covered_area(strip, atlas.rgba) == pytest.approx(covered_area(leaf, atlas.rgba), rel=0.2)
        blade = leaf.points[3:]  # without the petiole
        assert_allclose(strip.points.mean(axis=0), blade.mean(axis=0), atol=0.12)
        facing = [p.normals.mean(axis=0) for p in (leaf, strip)]
        assert facing[0] @ facing[1] > 0.5
    assert simpler(atlas.prototypes[0], 99) is atlas.prototypes[0]
    with pytest.raises(ValueError, match="at least 2"):
        simpler(atlas.prototypes[0], 1)


def test_covered_area_counts_opaque_texels_only() -> None:
    atlas = blade_atlas()
    leaf = atlas.prototypes[0]
    whole = face_areas(leaf.points, leaf.faces).sum()
    opaque = atlas.rgba.copy()
    opaque[..., 3] = 255
    assert covered_area(leaf, opaque) == pytest.approx(whole)
    opaque[..., 3] = 0
    assert covered_area(leaf, opaque) == 0
    assert 0.7 * whole < covered_area(leaf, atlas.rgba) < whole


def test_sizes_of_a_forks_limbs_by_hand() -> None:
    skeleton = fork(side_radius=0.1)
    length, area = limb_sizes(limbs_along(skeleton, thickest_child(skeleton)), skeleton)
    assert_allclose(length, [4.0, 1.5])
    assert_allclose(area, [4.0 * 0.4, 1.5 * 0.2])


def test_thickening_keeps_the_area_and_thickens_the_thin_most() -> None:
    area = np.array([5.0, 1.0, 1.0, 1.0, 1.0, 0.5, 0.5])
    share = np.array([1.0, 0.5, 0.5, 0.5, 0.5, 0.25, 0.25])
    keeps = np.array([True, True, True, False, False, True, False])
    factor = thickening(area, share, keeps)
    assert factor[0] == 1
    assert (factor * area)[keeps].sum() == pytest.approx(area.sum())
    assert factor[5] == pytest.approx(2 * factor[1])
    assert_array_equal(thickening(area, share, np.ones(7, bool)), np.ones(7))


def test_polygons_are_narrower_than_their_circles() -> None:
    assert_allclose(polygon_width(np.array([3, 4, 1000])), [0.827, 0.900, 1.0], atol=1e-3)


def test_limbs_that_a_finer_level_drops_a_coarser_one_drops_too() -> None:
    skeleton = bushy_tree(0).skeleton
    for is_bare, finest in ((False, 0.01), (True, 0.1)):
        steps = (0.0, finest, 3 * finest, 10 * finest)
        kept = [{tuple(p) for p in thinned_out(skeleton, step, is_bare=is_bare).position} for step in steps]
        assert kept[3] < kept[2] < kept[1] < kept[0]
        assert kept[0] == {tuple(p) for p in skeleton.position}
        assert {tuple(p) for p in skeleton.position[:10]} <= kept[3]  # the trunk stays


def test_a_thickened_twig_is_never_thicker_than_what_bears_it() -> None:
    thin = thinned_out(bushy_tree(0).skeleton, 0.1, is_bare=False)
    assert np.all(thin.radius[1:] <= thin.radius[thin.parent[1:]] * 1.5)
    assert thinned_out(Skeleton(np.zeros((1, 3)), np.array([-1]), np.ones(1)), 9.0, is_bare=True).radius[0] == 1
