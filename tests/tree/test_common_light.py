"""Photos in different light: their foliage comes out alike, and each leaf takes the colours of those that show it."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.common_light import KEPT, in_common_light, look
from forestgen.tree.foliage_colour import colours_at, facing
from forestgen.tree.foliage_unmixing import pure_foliage
from forestgen.tree.photo import Photo
from forestgen.tree.view import View
from tests.synthetic import drawn_tree


@pytest.fixture(scope="module")
def view() -> View:
    return drawn_tree(px_per_metre=60.0).view


def dimmed(view: View, gain: list[float], azimuth: float = np.pi / 2) -> View:
    """The same view from another side, its photo's channels times `gain` (3)."""
    rgb = np.clip(view.photo.rgb * np.array(gain), 0, 255).astype(np.uint8)
    return replace(view, photo=Photo(rgb, "dim.png"), camera=replace(view.camera, azimuth=azimuth))


def test_one_view_and_like_views_stay_as_they_are(view: View) -> None:
    own = pure_foliage(view)
    assert_array_equal(in_common_light([view])[0].rgb, own.rgb)
    for pure in in_common_light([view, dimmed(view, [1, 1, 1])]):
        assert np.abs(pure.rgb.astype(int) - own.rgb).max() <= 1


def test_looks_draw_near_and_the_background_stays(view: View) -> None:
    views = [view, dimmed(view, [0.8, 0.75, 0.85])]
    pure = [pure_foliage(v) for v in views]
    before = [look(v, p)[0] for v, p in zip(views, pure, strict=True)]
    moved = in_common_light(views)
    after = [look(v, p)[0] for v, p in zip(views, moved, strict=True)]
    assert_allclose(after[0] - after[1], KEPT * (before[0] - before[1]), atol=1.5)
    outside = ~view.mattes.is_foliage
    for p, m in zip(pure, moved, strict=True):
        assert_array_equal(p.rgb[outside], m.rgb[outside])
        assert_array_equal(p.share, m.share)


def test_photos_far_apart_are_told(view: View, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        in_common_light([view, dimmed(view, [0.9, 0.9, 0.9])])
        assert not caplog.records
        in_common_light([view, dimmed(view, [0.2, 0.25, 0.5])])
    assert "photo 2 shows its foliage in another light" in caplog.text


def test_a_leaf_takes_the_mean_of_the_views_that_show_it(view: View) -> None:
    views = [view, dimmed(view, [1, 1, 1])]
    shape = (*view.mattes.foliage.shape, 3)
    maps = [np.full(shape, 10, np.float32), np.full(shape, 50, np.float32)]
    points = np.array([[0.0, 3.0, 1.0], [1.0, 3.0, 0.0], [0.5, 3.0, 0.5]])
    weight = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 3.0]])
    assert_allclose(colours_at(views, maps, points, weight)[:, 0], [10, 50, 40])
    outside = np.stack([v.camera.axes[2] for v in views])
    assert_array_equal(facing(views, outside), np.eye(2))
