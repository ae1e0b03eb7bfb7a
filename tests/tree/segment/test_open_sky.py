"""Open sky: what shows between petals leaves the matte; leaves before a hedge and limbs stay as they are."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from forestgen.tree.segment.open_sky import without_sky
from forestgen.tree.segment.region import Region, look_at
from forestgen.tree.strokes import Strokes
from tests.synthetic import draw_discs

SKY, PETAL = np.array([70, 140, 220.0]), np.array([240, 238, 228.0])
SHAPE = (300, 300)


def blossom(behind: NDArray[np.float64]) -> tuple[Region, NDArray[np.float32], NDArray[np.float32]]:
    """A round crown of petals before a picture or colour, the share of petal of each pixel, the cut's matte."""
    rng = np.random.default_rng(5)
    crown = draw_discs(np.array([[150.0, 130.0]]), np.array([90.0]), SHAPE) >= 0.5
    rough = cv2.GaussianBlur(rng.normal(size=SHAPE).astype(np.float32), (0, 0), 2)
    share = np.clip(0.5 + 1.5 * (rough / rough.std() + 0.8), 0, 1) * crown
    petal = PETAL * (1 + 0.03 * rng.normal(size=(*SHAPE, 1)))
    rgb = np.clip(share[..., None] * petal + (1 - share[..., None]) * behind, 0, 255).astype(np.uint8)
    outline = 150 + 92 * np.stack([np.cos(np.linspace(0, 6.2, 40)), np.sin(np.linspace(0, 6.2, 40))], axis=1)
    strokes = Strokes(outline - [0, 20], (np.array([[150.0, 290], [150, 130]]),), size=(300, 300))
    region = look_at(rgb, strokes, 2)
    return region, share[region.window].astype(np.float32), crown[region.window].astype(np.float32)


def test_sky_between_petals_is_taken_out() -> None:
    region, share, matte = blossom(SKY)
    is_tree, found = share >= 0.5, without_sky(region, matte, np.zeros_like(matte))
    before = (is_tree & (matte >= 0.5)).sum() / (is_tree | (matte >= 0.5)).sum()
    after = (is_tree & (found >= 0.5)).sum() / (is_tree | (found >= 0.5)).sum()
    assert after > 0.93 > 0.9 > before
    assert (found <= matte).all()
    assert found[share == 1].mean() > 0.99


def test_before_a_hedge_nothing_changes() -> None:
    hedge = np.random.default_rng(6).uniform(20, 200, (*SHAPE, 3))
    region, _, matte = blossom(hedge)
    assert_array_equal(without_sky(region, matte, np.zeros_like(matte)), matte)


def test_without_leaves_there_is_nothing_to_do() -> None:
    region, _, matte = blossom(SKY)
    assert_array_equal(without_sky(region, np.zeros_like(matte), matte), np.zeros_like(matte))
