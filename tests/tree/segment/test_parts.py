"""The parts of segmentation alone: regions, the paper's clusters, soft edges, paint, lines, background."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.colour_model import Mixture, fit_mixture
from forestgen.tree.segment.background_field import spread_background
from forestgen.tree.segment.bare import is_bare_crown
from forestgen.tree.segment.green_red import most_green_or_red, split_clusters
from forestgen.tree.segment.lines import edge_directions
from forestgen.tree.segment.region import bounding, dilations_px, look_at
from forestgen.tree.segment.soft_edge import soften, without_strays
from forestgen.tree.segment.wood import follow_limbs, share_out
from tests.tree.segment import scenes


def test_region_widens_the_crown_and_keeps_its_ring_outside() -> None:
    scene = scenes.leafy()
    region = look_at(scene.photo.rgb, scene.strokes, 42)  # 42 px at 1500 px is 12 px in this photo of 420
    assert dilations_px(42, scene.photo.size) == 12
    assert dilations_px(10, (1500, 1000)) == 10
    assert not (region.is_ring & region.is_inside).any()
    assert_allclose(region.depth[region.is_inside].min(), -12, atol=0.6)
    x, y = region.local(np.array([scenes.CENTRE]))[0].astype(int)
    assert_allclose(region.depth[y, x], scenes.CROWN_RADIUS + 6, atol=4)  # a polygon; OpenCV measures to 2 %
    back = region.full(region.depth, scene.photo.size)
    assert_array_equal(back[region.window], region.depth)


def test_background_strokes_belong_to_the_ring() -> None:
    stroke = np.array([[170.0, 60], [190, 60]])  # in the crown: a person says that this is sky
    drawn = scenes.strokes(background=(stroke,))
    region = look_at(scenes.leafy().photo.rgb, drawn, 10)
    x, y = region.local(stroke)[0].astype(int)
    assert region.is_ring[y, x + 10]


def test_bounding_window() -> None:
    mask = np.zeros((6, 7), bool)
    assert bounding(mask) == (slice(0, 0), slice(0, 0))
    mask[2, 3] = mask[4, 5] = True
    assert bounding(mask) == (slice(2, 5), slice(3, 6))


def test_most_green_or_red() -> None:
    #        green leaf    red leaf       white        sky            grey
    colours = [[60, 140, 40], [200, 60, 40], [250, 250, 250], [120, 160, 220], [90, 90, 90]]
    value = most_green_or_red(np.array(colours) / 255)
    assert_allclose(value * 255, [90, 150, 0, -10, 0], atol=1e-9)
    clusters = Mixture(np.full(5, 0.2), np.array(colours) / 255, np.tile(0.01 * np.eye(3), (5, 1, 1)))
    leaf, rest = split_clusters(clusters, 2)
    assert_array_equal(np.round(leaf.mean * 255), [[200, 60, 40], [60, 140, 40]])
    assert len(rest) == 3
    assert len(split_clusters(clusters, 9)[1]) == 1


def test_soft_edges_recover_a_known_alpha() -> None:
    # a dark tree before a bright sky, its edge falling between two pixels at x = 20.3
    alpha = np.clip(20.3 - np.arange(40), 0, 1) * np.ones((30, 1))
    rgb = alpha[..., None] * np.array([0.2, 0.3, 0.1]) + (1 - alpha[..., None]) * np.array([0.7, 0.8, 0.9])
    found = soften(rgb.astype(np.float32), alpha >= 0.5)
    assert_allclose(found, alpha, atol=0.02)
    wrong = soften(rgb.astype(np.float32), np.roll(alpha, 1, axis=1) >= 0.5)
    assert_allclose(wrong[:, 5:], alpha[:, 5:], atol=0.1)  # also from a mask that is one pixel too wide


def test_soft_edges_leave_masks_alone_where_colours_tell_nothing() -> None:
    mask = np.zeros((20, 20), bool)
    mask[5:15, 5:15] = True
    assert_array_equal(soften(np.full((20, 20, 3), 0.5, np.float32), mask), mask.astype(np.float32))


def test_lines_run_one_way_and_discs_do_not() -> None:
    rng = np.random.default_rng(0)
    bars = np.zeros((80, 80), bool)
    bars[:, ::8] = bars[:, 1::8] = True
    dots = rng.random((80, 80)) < 0.3
    share = {}
    for name, mask in {"bars": bars, "dots": dots}.items():
        strength, directed = edge_directions(mask, 1.5)
        share[name] = directed.sum() / strength.sum()
    assert share["bars"] > 0.9
    assert share["dots"] < 0.5


def test_background_follows_the_place() -> None:
    # blue above, orange below, both known only to the left and right of a middle band
    rgb = np.empty((80, 60, 3), np.float32)
    rgb[:40], rgb[40:] = (0.3, 0.5, 0.8), (0.8, 0.5, 0.2)
    rng = np.random.default_rng(0)
    rgb += rng.normal(0, 0.01, rgb.shape).astype(np.float32)
    known = np.ones((80, 60), bool)
    known[:, 20:40] = False
    model = fit_mixture(rgb[known], 4, rng=rng)
    field = spread_background(rgb, known.astype(np.float32), known, known, model)
    gain = field.log_density(rgb) - field.log_density(np.ascontiguousarray(rgb[::-1]))
    assert gain[4:32, 20:40].mean() > 2
    assert gain[48:76, 20:40].mean() > 2
    assert np.isfinite(field.log_density(np.zeros_like(rgb))).all()


def test_sharing_out_leaves_no_seam() -> None:
    alpha = np.full((10, 10), 0.8, np.float32)
    is_leaf, is_wood = np.zeros((2, 10, 10), bool)
    is_leaf[:, :4] = is_wood[:, 4:9] = True
    leaf, wood = share_out(alpha, is_leaf, is_wood)
    assert_array_equal(np.maximum(leaf, wood), alpha)
    assert_array_equal(np.minimum(leaf, wood), 0)
    assert (wood[:, 9] > 0).all()  # the rim beyond the wood is the wood's


@pytest.mark.parametrize(("scene", "expected"), [(scenes.bare(), True), (scenes.leafy(), False)])
def test_bare_crowns_are_told_from_leafy_ones(scene: scenes.Scene, expected: bool) -> None:
    rng = np.random.default_rng(0)
    region = look_at(scene.photo.rgb, scene.strokes, 10)
    limbs = follow_limbs(region, scene.strokes, rng=rng)
    assert is_bare_crown(region, scene.is_tree[region.window], limbs.cover) is expected
    assert not is_bare_crown(region, np.zeros_like(region.is_inside), limbs.cover)


def test_small_patches_that_stand_apart_are_strays() -> None:
    alpha = np.zeros((100, 100), np.float32)
    alpha[20:60, 20:60] = 1  # the crown
    alpha[20:22, 61:63] = 1  # a tuft near it
    alpha[80:82, 80:82] = 1  # a stray, and its soft rim
    alpha[79, 80:82] = 0.3
    alpha[70:90, 2:22] = 1  # another large part
    out = without_strays(alpha, 200.0)
    assert not out[75:, 70:].any()
    kept = np.ones_like(alpha, bool)
    kept[75:, 70:] = False
    assert_array_equal(out[kept], alpha[kept])
    small = alpha * 0
    small[80:82, 80:82] = 1
    assert_array_equal(without_strays(small, 200.0), small)  # nothing large to stand apart from
