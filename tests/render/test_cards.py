"""Baked cards against the trees that they stand for."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.camera import Camera
from forestgen.check import metrics
from forestgen.render import Drawable, Studio
from forestgen.render.card_cutout import bled, cutout_alpha, shown_area
from forestgen.render.card_mips import block_means, lasting_alpha
from forestgen.render.card_solid import FEW
from forestgen.render.card_wood import corners
from forestgen.render.cards import CardPlan, bake_cards, plan_cards
from forestgen.render.model_drawables import level_drawables
from forestgen.tree.level import full_level
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Leaves, TreeModel
from forestgen.tree.skeleton import Skeleton
from tests.render.small_trees import HEIGHT, forked_tree

PX = 60  # rows that the tree covers where cards take over
FINER = 8
SMALL = 256  # px of a texture that is quickly made
VIEWS = [(0, 0), (45, 0), (90, 0), (135, 0), (30, 30)]


def seen(drawables: list[Drawable], azimuth: float, elevation: float) -> np.ndarray:
    """Premultiplied picture (H, W, 4) of a tree PX rows tall, averaged over each pixel."""
    size = (PX * FINER, int(1.4 * PX) * FINER)
    scale = PX * FINER / HEIGHT
    camera = Camera(size, (size[0] / 2, 1.2 * PX * FINER), scale, np.radians(azimuth), np.radians(elevation))
    with Studio(drawables) as studio:
        fine = studio.colour(camera)
    return fine.reshape(size[1] // FINER, FINER, size[0] // FINER, FINER, 4).mean(axis=(1, 3))


def both(model: TreeModel, *, leafy: bool = True) -> tuple[list[Drawable], list[Drawable]]:
    """The tree in full, and as cards."""
    rgba = model.atlas.rgba if leafy else None
    plan = plan_cards(model)
    texture = bake_cards(plan, model, rgba)
    cards = level_drawables(plan.level(model), model.bark, None, texture)
    return level_drawables(full_level(model), model.bark, rgba), cards


@pytest.mark.gl
def test_cards_have_the_trees_outline_and_colour_from_all_sides():
    full, cards = both(forked_tree(1500))
    overlap, shift = [], []
    for view in VIEWS:
        a, b = seen(full, *view), seen(cards, *view)
        mask_a, mask_b = a[..., 3] >= 0.5, b[..., 3] >= 0.5
        outer = metrics.envelope(mask_a, PX)
        overlap.append(metrics.iou(outer, metrics.envelope(mask_b, PX)))
        shift.append(metrics.colour_delta_e(own(a), mask_a, own(b), mask_b, outer, PX))
    assert np.mean(overlap) >= 0.97, overlap
    assert np.mean(shift) <= 2, shift


def own(picture: np.ndarray) -> np.ndarray:
    """Straight colours (H, W, 3) of a premultiplied picture."""
    return (picture[..., :3] / np.maximum(picture[..., 3:], 1e-6)).astype(np.float32)


@pytest.mark.gl
@pytest.mark.parametrize("view", [(0, 0), (90, 0)])
def test_sparse_leaves_neither_vanish_nor_swell(view):
    """Leaves smaller than a texel: as much is covered as the full tree covers."""
    full, cards = both(forked_tree(200))
    assert seen(cards, *view)[..., 3].sum() == pytest.approx(seen(full, *view)[..., 3].sum(), rel=0.06)


@pytest.mark.gl
def test_one_leaf_lies_where_it_hung_on_three_cards():
    leaf = Leaves(np.array([[0.7, 3.0, 0.2]]), np.array([[1.0, 0, 0, 0]]), np.array([0.4]), np.array([0]))
    model = forked_tree(1, leaves=leaf)
    plan = plan_cards(model)
    shown = plan.mesh.points.reshape(-1, 4, 3)[plan.leaf_card[0]]
    assert len(set(plan.leaf_card[0])) == 3
    front = shown[0]
    assert_allclose(front[:, 2], 0.2, atol=1e-3)  # the card across z goes through the leaf
    texture = bake_cards(plan, model, model.atlas.rgba)
    x, y, width, height = plan.cell[plan.leaf_card[0, 0]]
    cell = texture[y : y + height, x : x + width]
    is_leaf = (cell[..., 3] >= 128) & (cell[..., :3] == [80, 130, 50]).all(axis=2)
    assert is_leaf.sum() == pytest.approx((0.4 * plan.px_per_metre) ** 2, rel=0.08)


@pytest.mark.gl
def test_without_leaves_the_cards_show_twigs_alone():
    model = forked_tree(300)
    plan = plan_cards(model, side=SMALL)
    bare = bake_cards(plan, model, None)
    leafy = bake_cards(plan, model, model.atlas.rgba)
    shows, showed = bare[..., 3] >= 128, leafy[..., 3] >= 128
    assert 0 < shows.sum() < 0.2 * showed.sum()
    bark = model.bark.rgb.reshape(-1, 3)
    colour = bare[shows][:, :3]
    assert (colour >= bark.min(axis=0)).all()
    assert (colour <= bark.max(axis=0)).all()


@pytest.mark.gl
def test_a_tree_without_leaves_has_its_twigs_on_cards_or_no_cards_at_all():
    model = forked_tree(0)
    plan = plan_cards(model, side=SMALL)
    assert len(plan.twig)
    assert len(plan.leaf_card) == 0
    assert (bake_cards(plan, model, None)[..., 3] >= 128).any()
    trunk = forked_tree(0)
    thick = plan_cards(with_radius(trunk, 0.1), side=SMALL)
    assert not len(thick.mesh.faces)
    assert not bake_cards(thick, with_radius(trunk, 0.1), None).any()


def with_radius(model: TreeModel, radius: float) -> TreeModel:
    """The tree with all its wood equally thick."""
    skeleton = Skeleton(model.skeleton.position, model.skeleton.parent, np.full(len(model.skeleton), radius))
    return replace(model, skeleton=skeleton, mesh=GeneralisedCylinders()(skeleton, model.bark))


@pytest.mark.gl
def test_no_bright_fringe_where_the_cut_out_ends():
    """Every texel has the one colour of the leaves or of the bark; none has the empty background's."""
    model = forked_tree(300)
    plan = plan_cards(model, side=SMALL)
    texture = bake_cards(plan, model, model.atlas.rgba).astype(int)
    bark = model.bark.rgb.reshape(-1, 3).astype(int)
    low = np.minimum(bark.min(axis=0), [80, 130, 50]) - 1
    high = np.maximum(bark.max(axis=0), [80, 130, 50]) + 1
    assert (texture[..., :3] >= low).all()
    assert (texture[..., :3] <= high).all()


@pytest.mark.gl
def test_the_same_bytes_again():
    model = forked_tree(200)
    first, second = (bake_cards(plan_cards(model, side=SMALL), model, model.atlas.rgba) for _ in range(2))
    assert first.tobytes() == second.tobytes()
    assert plan_cards(model, side=SMALL).mesh.points.tobytes() == plan_cards(model, side=SMALL).mesh.points.tobytes()


def test_a_plan_is_lean_and_its_cells_lie_apart():
    plan = plan_cards(forked_tree(1500))
    assert 2 * len(plan.cell) + len(plan.wood.faces) <= 500
    assert plan.level(forked_tree(1500)).n_triangles <= 500 + 2 * FEW * 1500
    left, top, width, height = plan.cell.T
    for k in range(len(plan.cell)):
        near = (left < left[k] + width[k] + 4) & (left + width + 4 > left[k])
        near &= (top < top[k] + height[k] + 4) & (top + height + 4 > top[k])
        assert near.sum() == 1, f"cell {k} is nearer than 4 px to another"
    assert left.min() >= 0
    assert top.min() >= 0
    assert (left + width).max() <= plan.side
    assert (top + height).max() <= plan.side


def test_every_leaf_is_within_half_a_gap_of_its_cards():
    model = forked_tree(1500)
    plan = plan_cards(model)
    depth = np.einsum("lki,li->lk", plan.frame[plan.leaf_card][:, :, 2, :3], model.leaves.position)
    depth = (depth + plan.frame[plan.leaf_card][:, :, 2, 3]) / plan.px_per_metre
    gap = (2 + 2 + 2 / 1.5) / 100
    assert np.abs(depth).max() <= 1.5 * gap / 2 + 0.14  # a leaf's foot is up to its length from its middle


def test_outer_sides_face_outwards():
    plan = plan_cards(forked_tree(1500))
    corner = plan.mesh.points[plan.mesh.faces]
    ahead = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    centre = (plan.mesh.points.min(axis=0) + plan.mesh.points.max(axis=0)) / 2
    away = np.einsum("fi,fi->f", ahead, corner.mean(axis=1) - centre)
    assert (away >= -1e-9 * np.abs(away).max()).all()
    assert (np.einsum("fi,fi->f", ahead, plan.mesh.normals[plan.mesh.faces[:, 0]]) > 0).all()


def test_another_trees_plan_is_refused():
    plan = plan_cards(forked_tree(30))
    with pytest.raises(ValueError, match="show 30 leaves, but forked has 20"):
        plan.level(forked_tree(20))
    with pytest.raises(ValueError, match="show 30 leaves, but forked has 20"):
        bake_cards(plan, forked_tree(20), None)


@pytest.mark.parametrize("cover", [0.1, 0.3, 0.7])
def test_cut_outs_keep_the_area_of_noise(cover):
    """Fine noise of some mean: plain alpha at one half would show all of it or nothing."""
    rng = np.random.default_rng(5)
    coverage = np.clip(rng.normal(cover, 0.05, (96, 96)), 0, 1).astype(np.float32)
    alpha = cutout_alpha(coverage, coverage)
    fine = cv2.resize(alpha, (960, 960), interpolation=cv2.INTER_LINEAR)
    assert (fine > 0.5).mean() == pytest.approx(cover, abs=0.03)
    assert (coverage > 0.5).mean() in (0, 1)


@pytest.mark.parametrize("samples", [1, 4, 8])
def test_what_all_cover_equally_little_stays_clear_and_what_is_full_shows(samples):
    """Sixteen samples a texel make ties: all of them show or none, and all would be too much."""
    coverage = np.full((32, 32), samples / 16, np.float32)
    assert (cutout_alpha(coverage, coverage) < 0.5).all()
    full = np.ones((32, 32), np.float32)
    assert (cutout_alpha(full, full * np.float32(0.85)) >= 0.5).all()


@pytest.mark.gl
def test_plain_mip_levels_keep_the_cards_covered():
    """Averaged over 4 x 4 texels few leaves cover one half: a plain cut-out would lose most of the crown there."""
    model = forked_tree(1500)
    alpha = bake_cards(plan_cards(model), model, model.atlas.rgba)[..., 3].astype(np.float32) / 255
    area = shown_area(alpha).mean()
    assert shown_area(block_means(alpha, 2)).mean() / area == pytest.approx(1, abs=0.3)
    assert shown_area(block_means(alpha, 4)).mean() / area == pytest.approx(1, abs=0.4)
    cut = (alpha >= 0.5).astype(np.float32)
    assert shown_area(block_means(cut, 4)).mean() / area < 0.5


def test_raising_never_shows_what_is_empty_nor_fills_clear_ground():
    coverage = np.zeros((64, 64), np.float32)
    coverage[20:28, 20:28] = 0.3
    alpha = lasting_alpha(coverage, coverage)
    far = np.ones((64, 64), bool)
    far[8:40, 8:40] = False  # no block of 8 texels away touches what is covered
    assert (alpha[far] == 0).all()
    assert (alpha[coverage == 0] < 0.5).all()


def test_cut_outs_leave_full_and_empty_alone():
    coverage = np.zeros((32, 32), np.float32)
    coverage[:, 16:] = 1
    alpha = cutout_alpha(coverage, coverage)
    assert (alpha[:, :15] == 0).all()
    assert (alpha[:, 17:] >= 0.5).all()


def test_what_covers_hardly_anything_keeps_its_colour():
    picture = np.zeros((16, 16, 4), np.float32)
    picture[8, 4:12] = np.array([0.5, 0.25, 0.125, 1]) * 0.1  # a twig a tenth of a texel wide
    texture = bled(picture, (picture[..., 3] > 0).astype(np.float32))
    assert (texture[..., :3] == [128, 64, 32]).all()
    assert (texture[8, 4:12, 3] == 255).all()


def test_corners_are_the_bends():
    points = np.array([[0, 0, 0], [1, 0.01, 0], [2, 0, 0], [2, 1, 0], [2, 2, 0.0]])
    assert_array_equal(corners(points, 0.1), [0, 2, 4])
    assert_array_equal(corners(points, 0.001), [0, 1, 2, 4])


def test_a_plan_checks_itself():
    plan = plan_cards(forked_tree(3))
    with pytest.raises(ValueError, match="share"):
        CardPlan(**{**vars(plan), "share": np.ones(1)})
