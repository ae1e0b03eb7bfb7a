"""Lines of likely wood: thin limbs among leaves are found, leaves' shade is not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from forestgen.tree.segment.line_search import on_lines

SIZE = 400
EVERYWHERE = np.ones((SIZE, SIZE), bool)


def limb(angle_deg: float, width: int) -> NDArray[np.bool_]:
    """A straight limb through the middle of the picture."""
    step = 150 * np.array([np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))])
    ends = np.round(SIZE / 2 + np.outer([-1, 1], step)).astype(int)
    picture = np.zeros((SIZE, SIZE), np.uint8)
    cv2.line(picture, ends[0].tolist(), ends[1].tolist(), 1, width)
    return picture > 0


@pytest.mark.parametrize("angle", [0, 20, 45, 97, 160])
@pytest.mark.parametrize("width", [3, 6, 12])
def test_a_limb_of_any_direction_and_width_is_found_under_noise(angle: float, width: int) -> None:
    noise = np.random.default_rng(1).normal(0, 1.0, (SIZE, SIZE))
    wood = limb(angle, width)
    found = on_lines((np.where(wood, 1.5, -2.0) + noise).astype(np.float32), EVERYWHERE, SIZE)
    beside = cv2.dilate(wood.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    assert found[wood].mean() > 0.9
    assert found[~beside].mean() < 0.005


def test_shade_between_leaves_is_no_limb() -> None:
    rng = np.random.default_rng(2)
    rough = cv2.GaussianBlur(rng.normal(size=(SIZE, SIZE)).astype(np.float32), (0, 0), 2.5)
    shade = rough > np.quantile(rough, 0.85)
    found = on_lines(np.where(shade, 1.5, -2.0).astype(np.float32), EVERYWHERE, SIZE)
    assert found[shade].mean() < 0.12


def test_what_is_coloured_like_the_leaves_is_a_limb_only_where_it_stands_alone() -> None:
    wood = limb(30, 4)
    evidence = np.where(wood, 0.0, -3.0).astype(np.float32)
    assert on_lines(evidence, wood, SIZE)[wood].mean() > 0.9
    assert not on_lines(evidence, EVERYWHERE, SIZE).any()


def test_nothing_is_found_outside_the_tree_or_where_all_is_alike() -> None:
    wood = limb(30, 4)
    evidence = np.where(wood, 2.0, -3.0).astype(np.float32)
    assert not on_lines(evidence, ~wood, SIZE)[wood].any()
    assert not on_lines(np.full((SIZE, SIZE), 2.0, np.float32), EVERYWHERE, SIZE).any()
    assert not on_lines(np.full((20, 20), 2.0, np.float32), np.ones((20, 20), bool), 20.0).any()


def test_a_larger_photo_shows_the_same_limbs() -> None:
    wood = limb(70, 4)
    evidence = np.where(wood, 2.0, -2.0).astype(np.float32)
    large = cv2.resize(evidence, None, fx=3, fy=3, interpolation=cv2.INTER_NEAREST)
    found = on_lines(large, np.ones(large.shape, bool), 3 * SIZE)
    assert found[large > 0].mean() > 0.9
