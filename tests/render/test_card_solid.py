"""What stays solid beside cards: which leaves and twigs draw the outlines, and how they are drawn."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.render.card_leaves import leaf_strips, strip_pieces
from forestgen.render.card_mesh import outward_mesh
from forestgen.render.card_outline import CELLS, outlines_of
from forestgen.render.card_solid import FEW, solid_things, straight_end, twig_wedges
from forestgen.render.cards import bake_cards, plan_cards
from forestgen.render.outline_kernels import foremost, mark
from forestgen.tree.places import leaf_matrices
from tests.render.small_trees import ball_of_leaves, forked_tree

SMALL = 256
CHAMFER = 0.02  # relative error of OpenCV's distances over 5 x 5


def ball(n: int, radius: float) -> np.ndarray:
    """Points (n, 3) evenly all over a ball's surface about (1, 2, 3)."""
    height = 1 - 2 * (np.arange(n) + 0.5) / n
    turn = np.pi * (1 + np.sqrt(5)) * np.arange(n)
    ring = np.sqrt(1 - height**2)
    return radius * np.stack([ring * np.cos(turn), height, ring * np.sin(turn)], axis=1) + [1.0, 2.0, 3.0]


def test_a_balls_outline_is_a_circle_from_every_side():
    outlines, _ = outlines_of(ball(20_000, 1.5), np.full(20_000, -1), 3.0)
    cell = 3.0 / CELLS
    for away in (0.0, 1.2, 1.5, 1.9):
        card = np.array([[1.0, 2.0, 3.0 + away], [1.1, 2.0, 3.0 + away], [1.0, 2.1, 3.0 + away]])
        assert outlines.farthest_beyond(card, (1, 1))[0, 0] == pytest.approx(away - 1.5, abs=2 * cell + CHAMFER * 1.5)


def test_a_card_is_judged_texel_by_texel():
    """A card across z through the middle of the ball, its texels 0.1 m: from -2 to 2 m along x, at y = 2."""
    outlines, _ = outlines_of(ball(20_000, 1.5), np.full(20_000, -1), 3.0)
    card = np.array([[-1.0, 2.0, 3.0], [-0.9, 2.0, 3.0], [-1.0, 1.9, 3.0]])
    found = outlines.farthest_beyond(card, (41, 1))[0]
    assert_allclose(found, np.abs(np.arange(41) * 0.1 - 2) - 1.5, atol=2 * 3.0 / CELLS + CHAMFER * 1.5)


def test_the_outermost_points_lead_an_outline():
    points = np.concatenate([ball(2000, 1.5), ball(2000, 1.2)])
    _, leads = outlines_of(points, np.arange(4000), 3.0)
    assert leads[:2000].sum() > 12 * 100
    assert not leads[2000:].any()


def test_the_foremost_of_each_stretch_leads_it():
    """Two outside cells, and what lies next to each: 7 wins over 9, as deep, and over 6, which lies deeper."""
    depth = np.zeros((8, 8), np.float32)
    label = np.zeros((8, 8), np.int32)
    depth[0, :6] = [0, 1, 2, 3, 1, 0]
    label[0, :6] = [1, 1, 1, 2, 2, 2]
    cell = np.array([1, 1, 2, 4, 3, 2])
    found = foremost(cell, np.array([9, 7, 6, 3, 2, -1]), depth, label, np.float32(2.5), 4)
    assert_array_equal(found, [7, 3, -1, -1])
    assert_array_equal(foremost(cell[:0], cell[:0], depth, label, np.float32(2.5), 4), [-1] * 4)


def plainly_foremost(
    cell: np.ndarray, owner: np.ndarray, depth: np.ndarray, label: np.ndarray, reach: float, step: int
) -> np.ndarray:
    """The things that lead stretches, each once, found by sorting."""
    outside = np.argwhere(depth == 0)
    nearest = np.zeros((label.max() + 1, 2), np.int64)
    nearest[label[outside[:, 0], outside[:, 1]]] = outside
    near = (owner >= 0) & (depth.flat[cell] <= reach)
    stretch = nearest[label.flat[cell[near]]] // step
    order = np.lexsort((owner[near], depth.flat[cell[near]], stretch[:, 0], stretch[:, 1]))
    along = stretch[order]
    is_first = np.ones(len(order), bool)
    is_first[1:] = (along[1:] != along[:-1]).any(axis=1)
    return np.unique(owner[near][order[is_first]])


def test_compiled_loops_lead_as_sorting_does():
    rng = np.random.default_rng(3)
    inside = np.zeros((61, 61), np.uint8)
    cv2.circle(inside, (30, 33), 22, 1, -1)
    depth, label = cv2.distanceTransformWithLabels(inside, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    cell = rng.choice(np.flatnonzero(inside), 4000)
    for n_things in (30, 3000):
        owner = rng.integers(-1, n_things, 4000)
        found = foremost(cell, owner, depth, label, np.float32(4.8), 4)
        wanted = plainly_foremost(cell, owner, depth, label, 4.8, 4)
        assert_array_equal(np.unique(found[found >= 0]), wanted)
        assert len(wanted) > 5


def test_points_mark_the_cells_that_they_fall_on():
    cell, mask = np.zeros(3, np.int32), np.zeros(36, np.uint8)
    mark(np.array([-3, 0.9, 2.9], np.float32), np.array([-3, -0.1, 0], np.float32), 6, cell, mask)
    assert_array_equal(cell, [0, 2 * 6 + 3, 3 * 6 + 5])
    assert_array_equal(np.flatnonzero(mask), cell)


def test_a_straight_end_ends_at_the_bend():
    limb = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 2, 0], [2, 3, 0.0]])
    assert straight_end(limb, stray=0.01, longest=10) == 2
    assert straight_end(limb, stray=0.01, longest=1.5) == 4
    assert straight_end(limb, stray=9, longest=10) == 0
    assert straight_end(limb, stray=0.01, longest=0.1) == 4, "the last edge, however long"


def test_a_wedge_covers_as_much_as_a_round_twig_on_average():
    """Seen across its length from all around, one of 2 cm radius and 1 m length covers 0.04 m2."""
    twig = np.array([[[0.3, 0, 0], [0.3, 1, 0.0]]])
    solid = replace(solid_things(forked_tree(0)), twig=twig, radius=np.full((1, 2), 0.02))
    mesh = twig_wedges(solid, forked_tree(0).bark)
    assert len(mesh.faces) == 4
    corner = mesh.points[mesh.faces]
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) / 2
    assert_allclose(area.sum(axis=0), 0, atol=1e-12)  # closed
    seen = []
    for turn in np.linspace(0, np.pi, 60, endpoint=False):
        ahead = area @ [np.cos(turn), 0, np.sin(turn)]
        assert ahead.max() > 0, "nothing faces this side"
        seen.append(ahead[ahead > 0].sum())
    assert np.mean(seen) == pytest.approx(0.04, rel=0.02)
    assert np.min(seen) > 0.02


def test_few_of_the_leaves_stay_solid_and_they_are_the_outer_ones():
    model = forked_tree(2000)
    solid = solid_things(model)
    away = np.linalg.norm(model.leaves.position - [0.3, 2.9, 0.1], axis=1)
    assert 50 < len(solid.leaf) <= FEW * 2000
    assert away[solid.leaf].mean() > away.mean() + 0.1
    assert_array_equal(solid.leaf, solid_things(model).leaf)
    assert not len(solid_things(forked_tree(5)).leaf)


def test_a_bare_trees_twig_stays_solid_to_its_tip():
    solid = solid_things(forked_tree(0))
    tips = {tuple(tip) for tip in solid.twig[:, 1].tolist()}
    assert tips <= {(1.0, 3.9, 0.6), (-0.6, 3.2, 0.4)}
    assert tips


def test_a_strip_lies_where_the_leaf_hung():
    model = forked_tree(30)
    leaf = np.array([4, 17])
    points, uv, faces = strip_pieces(leaf_strips(model, leaf), np.array([[16, 8, 10, 20]]), 64)
    corners = model.atlas.prototypes[0].points
    wanted = [corners @ place[:3, :3].T + place[:3, 3] for place in leaf_matrices(model.leaves)[leaf]]
    assert_allclose(points, np.concatenate(wanted))
    assert_allclose(uv[:4] * 64, [[16, 36], [26, 36], [26, 56], [16, 56]])  # v upward: rows 8 to 28
    assert faces.max() == 7


def test_solid_leaves_show_their_own_cell_and_vanish_in_winter():
    model = forked_tree(1500)
    plan = plan_cards(model, side=SMALL)
    (left, top, width, height) = plan.strip_cell[0]
    cell = np.s_[top : top + height, left : left + width]
    assert (bake_cards(plan, model, model.atlas.rgba)[cell][1:-1, 1:-1, 3] >= 128).all()
    assert not bake_cards(plan, model, None)[cell][..., 3].any()


def test_every_piece_turns_its_side_away_from_the_middle_forward():
    model = forked_tree(40, leaves=ball_of_leaves(40, np.random.default_rng(1)))
    strips = leaf_strips(model, np.arange(40))
    mesh = outward_mesh(strip_pieces(strips, np.array([[0, 0, 8, 8]]), 64))
    corner = mesh.points[mesh.faces]
    ahead = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    middle = (mesh.points.min(axis=0) + mesh.points.max(axis=0)) / 2
    assert (np.einsum("fi,fi->f", ahead, corner.mean(axis=1) - middle) >= -1e-12).all()
    assert (np.einsum("fci,fi->fc", mesh.normals[mesh.faces], ahead) > 0).all()


def test_cards_are_cut_off_where_they_would_stick_out():
    """One far leaf in front of a slab's card: from the side the card would show it where it is not."""
    leaves = ball_of_leaves(3000, np.random.default_rng(2))
    plan = plan_cards(forked_tree(3000, leaves=leaves), n_slabs=6)
    texture = bake_cards(plan, forked_tree(3000, leaves=leaves), forked_tree(3000).atlas.rgba)
    is_beyond = plan.share == 0
    assert is_beyond.any()
    assert (texture[..., 3][is_beyond] < 128).all()


def test_no_leaves_make_no_strips():
    strips = leaf_strips(forked_tree(0), np.zeros(0, np.int64))
    points, uv, faces = strip_pieces(strips, np.zeros((0, 4), np.int64), 64)
    assert (len(points), len(uv), len(faces), len(strips.strip)) == (0, 0, 0, 0)
