"""Which colours are wood and which are leaf, where leaves hide the stroked limbs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.testing import assert_array_equal

from forestgen.tree.colour_model import Mixture
from forestgen.tree.segment.graph_cut import GraphCutFoliage
from forestgen.tree.segment.region import look_at
from forestgen.tree.segment.wood import follow_limbs
from forestgen.tree.segment.wood_colours import bark_colours, colours_under_strokes, distinct_colours
from tests.tree.segment import scenes

LEAF, BARK = (60, 120, 40), (95, 75, 60)


def hidden_trunk() -> scenes.Scene:
    """A tree whose stroke goes far up into leaves that hide the trunk: half of what lies under it is leaf."""
    scene = scenes.leafy(LEAF, BARK)
    rgb, up = scene.photo.rgb.copy(), slice(60, 250)
    under = (up, slice(160, 200))
    rgb[under] = np.random.default_rng(3).normal(LEAF, 12, (190, 40, 3)).clip(0, 255)
    is_leaf, is_wood = scene.is_leaf.copy(), scene.is_wood.copy()
    is_leaf[under], is_wood[under] = True, False
    row = np.linspace(scenes.ROOT[1], 70, 16)
    stroke = np.stack([np.full(16, scenes.ROOT[0]), row], axis=1)
    return scenes.Scene(replace(scene.photo, rgb=rgb), scenes.strokes(branches=(stroke,)), is_leaf, is_wood)


def nearest(model: Mixture, colour: tuple[int, ...]) -> float:
    """Distance of the nearest Gaussian's mean from a colour, of 255."""
    return float(np.linalg.norm(model.mean * 255 - np.array(colour), axis=1).min())


def test_leaves_over_a_stroked_trunk_are_not_learnt_as_wood() -> None:
    scene, rng = hidden_trunk(), np.random.default_rng(0)
    region = look_at(scene.photo.rgb, scene.strokes, 10)
    limbs = follow_limbs(region, scene.strokes, rng=rng)
    is_tree = scene.is_tree[region.window]
    under = colours_under_strokes(region, limbs.cover, rng)
    assert under is not None
    assert nearest(under, LEAF) < 15  # what lies under the stroke is half leaf
    bark = bark_colours(region, is_tree, limbs.cover, under, rng)
    assert nearest(bark, BARK) < 10
    assert nearest(bark, LEAF) > 30


def test_colours_under_the_stroke_stay_where_no_plain_trunk_shows() -> None:
    scene, rng = hidden_trunk(), np.random.default_rng(0)
    drawn = scenes.strokes(branches=(np.array([[180.0, 240], [180, 80]]),))  # begins within the crown
    region = look_at(scene.photo.rgb, drawn, 10)
    limbs = follow_limbs(region, drawn, rng=rng)
    under = limbs.colours
    assert under is not None
    assert bark_colours(region, scene.is_tree[region.window], limbs.cover, under, rng) is under


def test_leaves_before_the_trunk_are_foliage() -> None:
    scene = hidden_trunk()
    mattes = GraphCutFoliage()(scene.photo, scene.strokes, rng=np.random.default_rng(0))
    hidden = scene.is_leaf[90:240, 170:190]
    assert mattes.is_branch[90:240, 170:190][hidden].mean() < 0.1
    trunk = scene.is_wood[300:390]
    assert mattes.is_branch[300:390][trunk].mean() > 0.9


def test_wood_clusters_near_leaf_clusters_are_dropped() -> None:
    spread = np.tile(0.002 * np.eye(3), (2, 1, 1))
    wood = Mixture(np.array([0.5, 0.5]), np.array([[0.4, 0.3, 0.2], [0.2, 0.4, 0.1]]), spread)
    leaf = Mixture(np.ones(1), np.array([[0.2, 0.41, 0.1]]), spread[:1])
    kept = distinct_colours(wood, leaf)
    assert kept is not None
    assert_array_equal(kept.mean, wood.mean[:1])
    assert distinct_colours(wood.subset(np.array([1])), leaf) is None
    assert distinct_colours(None, leaf) is None
    assert distinct_colours(wood, None) is wood
