"""Limb edges: the dynamic programme against all paths, and bars of known width under wobbling strokes."""

from __future__ import annotations

from itertools import product

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from forestgen.tree.segment import edge_search
from forestgen.tree.segment.edge_search import best_edges
from forestgen.tree.segment.ribbon import TAPER, Ribbon, follow_limb, plausible_width, stations


def test_best_edges_beat_every_other_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(edge_search, "STRAY", 1)
    rng = np.random.default_rng(0)
    says, edge, widest = rng.normal(size=(3, 5)), rng.random((3, 6)), np.array([3.0, 2.0, 3.0])
    pairs = [(a, b) for a in range(4) for b in range(1, 5) if a <= b]

    def value(path: tuple[tuple[int, int], ...]) -> float:
        total = 0.0
        for s, (a, b) in enumerate(path):
            total += says[s, a : b + 1].sum() + edge[s, a] + edge[s, b + 1]
            total -= edge_search.EXCESS * max(0, b - a + 1 - widest[s])
            if s:
                steps = abs(a - path[s - 1][0]), abs(b - path[s - 1][1])
                if max(steps) > 1:
                    return -np.inf
                total -= edge_search.TURN * sum(steps)
        return total

    best = max(value(path) for path in product(pairs, repeat=3))
    low, high = best_edges(says, edge, widest)
    assert value(tuple(zip(low.tolist(), high.tolist(), strict=True))) == pytest.approx(best)


def bar(width: float, wood: tuple[int, ...], left: tuple[int, ...], right: tuple[int, ...]) -> NDArray[np.float32]:
    """A vertical bar about x = 100 in a picture 200 px wide and 240 high, lit from one side, with noise."""
    rng = np.random.default_rng(3)
    x = np.arange(200) + 0.5
    cover = np.clip(width / 2 + 0.5 - abs(x - 100), 0, 1)[None, :, None]
    beside = np.where(x[:, None] < 100, np.array(left), np.array(right))[None]
    lit = np.array(wood) * (1 + 0.25 * (100 - x[:, None]) / width)
    picture = cover * lit[None] + (1 - cover) * beside + rng.normal(0, 4, (240, 200, 3))
    return np.asarray(np.clip(picture, 0, 255) / 255, np.float32)


@pytest.mark.parametrize("width", [8, 20, 44])
@pytest.mark.parametrize(
    ("wood", "left", "right"),
    [
        pytest.param((100, 80, 60), (150, 180, 220), (110, 130, 60), id="sky and grass"),
        pytest.param((60, 60, 60), (95, 95, 95), (90, 90, 90), id="grey on grey"),
        pytest.param((220, 215, 205), (80, 110, 50), (150, 180, 220), id="birch"),
    ],
)
def test_width_of_a_bar_is_found(
    width: int, wood: tuple[int, ...], left: tuple[int, ...], right: tuple[int, ...]
) -> None:
    row = np.linspace(230, 10, 23)
    stroke = np.stack([100 + 0.3 * width * np.sin(row / 35), row], axis=1)
    ribbon = follow_limb(bar(width, wood, left, right), stroke, 60.0)
    middle = slice(len(ribbon.width) // 6, -len(ribbon.width) // 6)
    assert_allclose(np.median(ribbon.left[middle, 0]), 100 - width / 2, atol=1.3)
    assert_allclose(np.median(ribbon.right[middle, 0]), 100 + width / 2, atol=1.3)
    assert np.quantile(abs(ribbon.width[middle] - width), 0.9) < 0.06 * width + 1
    assert np.median(ribbon.clarity) > 1


def test_a_wall_like_the_bark_for_a_stretch_makes_no_bulge() -> None:
    picture = bar(20, (100, 80, 60), (150, 180, 220), (150, 180, 220))
    picture[90:130, 115:] = np.array([100, 80, 60]) / 255
    ribbon = follow_limb(picture, np.array([[100.0, 230], [100, 10]]), 60.0)
    assert ribbon.width.max() < 30


def test_width_is_limited_by_what_it_is_below() -> None:
    width = np.full(40, 20.0)
    width[15:18] = 60
    clear = np.full(40, 3.0)
    assert plausible_width(width, clear).max() < 25
    clear[20:] = 0
    limit = plausible_width(width, clear)
    assert limit[5] == pytest.approx(limit[15])
    assert limit[-1] == pytest.approx(TAPER * limit[5])


def test_among_leaves_a_limb_is_no_wider_than_where_it_is_bare() -> None:
    width = np.r_[34.0, 28, np.full(10, 20), np.full(28, 33)]
    limit = plausible_width(width, np.full(40, 3.0), 12 / 40)
    assert limit[12:].max() < 25
    assert plausible_width(width, np.full(40, 3.0)).max() > 30


def test_stations_are_even_and_normals_across() -> None:
    place, normal = stations(np.array([[0.0, 0], [0, 0], [30, 0]]), 1.0, smooth=3.0)
    assert_allclose(np.diff(place[:, 0]), 1, atol=1e-9)
    assert_allclose(normal, np.tile([0.0, 1.0], (len(place), 1)), atol=1e-9)


def test_coverage_is_the_area_of_the_outline() -> None:
    #  a 10 x 20 rectangle from (5.25, 3) on: columns 5 and 15 are covered by three and by one quarter
    row = np.linspace(3, 23, 21)
    ribbon = Ribbon(
        np.stack([np.full(21, 5.25), row], axis=1), np.stack([np.full(21, 15.25), row], axis=1), np.ones(21)
    )
    cover = ribbon.coverage((30, 40))
    assert cover.shape == (40, 30)
    assert_allclose(cover.sum(), 200, rtol=0.04)
    assert_allclose(cover[10, [4, 5, 10, 15, 16]], [0, 0.75, 1, 0.25, 0], atol=0.26)
    none = ribbon.coverage((30, 40), np.zeros(21, bool))
    assert not none.any()


def test_a_ribbon_outside_the_picture_covers_nothing() -> None:
    far = np.stack([np.full(5, 500.0), np.linspace(0, 9, 5)], axis=1)
    assert not Ribbon(far, far + np.array([4, 0]), np.ones(5)).coverage((30, 40)).any()


def test_a_limb_may_leave_the_picture() -> None:
    picture = cv2.GaussianBlur(bar(20, (60, 60, 60), (200, 200, 200), (200, 200, 200)), (0, 0), 1)
    ribbon = follow_limb(picture, np.array([[100.0, 239.5], [100, 120], [100, 0.5]]), 300.0)
    assert np.isfinite(ribbon.left).all()
    assert 14 < np.median(ribbon.width) < 26
