"""Sky out of foliage: known leaf colours before a known sky come back, and what is no sky is left alone."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from forestgen.tree.backdrop import Backdrop, facet, leaf_share, spread_backdrop
from forestgen.tree.foliage_unmixing import pure_foliage, sky_hue
from forestgen.tree.leaf_colours import lab_of
from forestgen.tree.photo import Photo
from forestgen.tree.view import View
from tests.synthetic import drawn_tree

SKY = np.array([90.0, 150.0, 240.0])
LEAF = np.array([60.0, 85.0, 30.0])


def before(behind: NDArray[np.float64], texture: float = 0.0) -> tuple[View, NDArray[np.float64]]:
    """The drawn tree's crown, a third of whose pixels are mixed with what is behind; and each one's share of leaf."""
    view = drawn_tree(px_per_metre=100.0).view
    rng = np.random.default_rng(0)
    shape = view.mattes.foliage.shape
    noise = cv2.GaussianBlur(rng.normal(size=shape).astype(np.float32), (0, 0), 2)
    share = np.where(noise > 0.43 * noise.std(), rng.uniform(0.45, 0.9, shape), 1.0)
    light = 1 + 0.1 * rng.normal(size=(*shape, 1))
    ground = behind * (1 + texture * rng.normal(size=(*shape, 1)))
    tree = (view.mattes.foliage + view.mattes.branch)[..., None] > 0.01
    alpha = share[..., None]
    rgb = np.where(tree, alpha * LEAF * light + (1 - alpha) * ground, ground)
    return replace(view, photo=Photo(np.clip(rgb, 0, 255).astype(np.uint8), "mixed.png")), share


def blueness(rgb: NDArray[np.uint8], where: NDArray[np.bool_]) -> float:
    return float(-lab_of(rgb[where])[:, 2].mean())


def test_foliage_before_blue_sky_comes_out_green() -> None:
    view, share = before(SKY)
    inside = view.mattes.is_foliage
    mixed = inside & (share < 0.7)
    pure = pure_foliage(view)
    was, became = blueness(view.photo.rgb, mixed), blueness(pure.rgb, mixed)
    assert became < -5 < 5 < was
    assert_array_equal(pure.rgb[~inside], view.photo.rgb[~inside])
    assert (pure.share[~inside] == 1).all()
    assert pure.share[mixed].mean() < 0.8 < pure.share[inside & (share == 1)].mean()
    assert np.corrcoef(pure.share[mixed], share[mixed])[0, 1] > 0.8


@pytest.mark.parametrize(
    ("behind", "texture"), [(SKY, 0.35), (np.array([90.0, 130.0, 60.0]), 0.0), (np.array([20.0, 25.0, 30.0]), 0.0)]
)
def test_hedge_lawn_and_shade_are_no_sky(behind: NDArray[np.float64], texture: float) -> None:
    view, _ = before(behind, texture)
    pure = pure_foliage(view)
    change = np.abs(pure.rgb.astype(int) - view.photo.rgb)[view.mattes.is_foliage]
    assert change.mean() < 2


def test_a_tree_before_nothing_is_left_alone() -> None:
    view, _ = before(SKY)
    full = replace(view, mattes=replace(view.mattes, foliage=np.ones_like(view.mattes.foliage)))
    assert_array_equal(pure_foliage(full).rgb, view.photo.rgb)


def test_the_backdrop_of_the_nearer_side_is_taken() -> None:
    colour = np.zeros((60, 90, 3), np.float32)
    colour[:, :45], colour[:, 45:] = (0.4, 0.6, 0.9), (0.9, 0.9, 0.9)
    is_open = np.ones((60, 90), bool)
    is_open[20:40, 10:80] = False
    colour[~is_open] = 0.1
    behind = spread_backdrop(colour, is_open)
    assert np.abs(behind.rgb[30, 15] - (0.4, 0.6, 0.9)).max() < 0.02
    assert np.abs(behind.rgb[30, 75] - 0.9).max() < 0.02


def test_share_is_the_way_from_the_sky_to_the_leaf() -> None:
    share = np.random.default_rng(0).uniform(0, 1, 4000).astype(np.float32)
    sky, leaf = np.array([0.4, 0.6, 0.9], np.float32), np.array([0.2, 0.3, 0.1], np.float32)
    colour = sky + share[:, None] * (leaf - sky)
    found = leaf_share(colour, np.broadcast_to(sky, colour.shape), np.ones(4000, np.float32))
    assert (np.diff(found[np.argsort(share)]) >= -1e-6).all()
    assert found[share > 0.8].min() > 0.99
    assert found[share < 0.2].max() < 0.35


def test_facets_tell_directions_apart() -> None:
    rng = np.random.default_rng(0)
    away = rng.normal(size=(500, 3)).astype(np.float32)
    cell = facet(away)
    assert_array_equal(cell, facet(7 * away))
    assert not np.any(cell == facet(-away))
    unit = away / np.linalg.norm(away, axis=1, keepdims=True)
    alike = cell[:, None] == cell
    assert (unit @ unit.T)[alike].min() > np.cos(np.deg2rad(36))


def test_a_grey_sky_has_no_hue() -> None:
    inside = np.ones((4, 4), bool)
    grey = Backdrop(np.full((4, 4, 3), 0.8, np.float32), np.ones((4, 4), np.float32))
    blue = Backdrop(np.tile(np.array([0.4, 0.6, 0.9], np.float32), (4, 4, 1)), np.ones((4, 4), np.float32))
    assert sky_hue(grey, inside) is None
    found = sky_hue(blue, inside)
    assert found is not None
    assert found[1] < -0.9
    assert sky_hue(Backdrop(blue.rgb, np.zeros((4, 4), np.float32)), inside) is None
