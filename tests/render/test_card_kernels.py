"""Compiled loops of the cards' alpha against the plain ones that they replace."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.render import card_cutout
from forestgen.render.card_cutout import bled, local_threshold, shown_area
from forestgen.render.card_kernels import raise_blocks
from forestgen.render.card_mips import block_means

FEW = 0.01  # of the texels: OpenCV interpolates a little otherwise on some processors


def noise(height: int, width: int) -> np.ndarray:
    """Coverage (H, W) in sixteenths: clear, full, and between."""
    rng = np.random.default_rng(height + 100 * width)
    coarse = cv2.resize(rng.normal(0.4, 0.4, (height // 4 + 1, width // 4 + 1)), (width, height))
    return (np.round(np.clip(coarse + rng.normal(0, 0.1, (height, width)), 0, 1) * 16) / 16).astype(np.float32)


def finer(image: np.ndarray, n: int) -> np.ndarray:
    height, width = image.shape
    return cv2.resize(image, (n * width, n * height), interpolation=cv2.INTER_LINEAR) if n > 1 else image


def plain_area(image: np.ndarray, threshold: np.ndarray, n: int) -> np.ndarray:
    shown = (finer(image, n) > finer(threshold, n)).astype(np.float32)
    return cv2.resize(shown, image.shape[::-1], interpolation=cv2.INTER_AREA)


def plain_threshold(coverage: np.ndarray, goal: np.ndarray, n: int) -> np.ndarray:
    near = (card_cutout.NEAR, card_cutout.NEAR)
    low, high = np.zeros_like(coverage), np.full_like(coverage, card_cutout.HIGHEST)
    for _ in range(card_cutout.HALVINGS):
        middle = (low + high) * np.float32(0.5)
        is_too_much = cv2.boxFilter(plain_area(coverage, middle, n), -1, near) > cv2.boxFilter(goal, -1, near)
        low, high = np.where(is_too_much, middle, low), np.where(is_too_much, high, middle)
    return np.maximum((low + high) / 2, card_cutout.LEAST)


@pytest.mark.parametrize("shape", [(64, 96), (37, 50), (3, 2), (1, 40), (1, 1)])
@pytest.mark.parametrize("n", [1, 3])
def test_thresholds_are_those_of_whole_pictures(shape, n):
    coverage = noise(*shape)
    goal = coverage * np.float32(0.85)
    found = local_threshold(coverage, goal, n)
    assert found.dtype == np.float32
    assert (found != plain_threshold(coverage, goal, n)).mean() <= FEW


@pytest.mark.parametrize("shape", [(64, 96), (37, 50), (2, 3)])
def test_shown_area_is_that_of_a_finer_picture(shape):
    alpha = noise(*shape)
    assert_allclose(shown_area(alpha), plain_area(alpha, np.full_like(alpha, 0.5), card_cutout.FINER), atol=1e-6)


@pytest.mark.parametrize("n", [8, 4, 2])
def test_blocks_rise_as_whole_pictures_do(n):
    alpha = noise(64, 96)
    is_shown = alpha >= 0.5
    most = np.where(is_shown, np.float32(1), np.maximum(alpha, np.float32(0.45)))
    is_wanted = np.random.default_rng(n).random((64 // n, 96 // n)) < 0.5
    lack = np.where(is_wanted, np.maximum(np.float32(0.62) - block_means(alpha, n), 0), np.float32(0))
    wanted = alpha
    for may_rise in (is_shown, ~is_shown):
        room = np.where(may_rise, most - alpha, np.float32(0))
        part = np.minimum(lack / np.maximum(block_means(room, n), np.float32(1e-6)), np.float32(1))
        wanted = wanted + room * part.repeat(n, axis=0).repeat(n, axis=1)
        lack = lack - part * block_means(room, n)
    raised = alpha.copy()
    raise_blocks(raised, is_shown, most, is_wanted, 0.62)
    assert_allclose(raised, wanted, atol=1e-6)
    assert (raised > alpha).mean() > 0.1


@pytest.mark.parametrize("full", [1.0, 0.2])
def test_colours_bleed_as_by_whole_pictures(full):
    rng = np.random.default_rng(8)
    coverage = noise(48, 40) * np.float32(full)
    picture = np.dstack([rng.random((48, 40, 3), np.float32) * coverage[..., None], coverage])
    alpha = rng.random((48, 40), np.float32) * np.float32(1.2) - np.float32(0.1)
    enough = coverage >= min(card_cutout.ENOUGH, coverage.max() / 2)
    rgb = picture[..., :3] / np.maximum(coverage, 1e-6)[..., None]
    _, label = cv2.distanceTransformWithLabels(
        (~enough).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    nearest = np.zeros((label.max() + 1, 3), np.float32)
    nearest[label[enough]] = rgb[enough]
    rgb = np.where((coverage >= card_cutout.OWN)[..., None], rgb, nearest[label])
    wanted = np.round(np.clip(np.dstack([rgb, alpha]), 0, 1) * 255)
    assert_allclose(bled(picture, alpha), wanted, atol=1)
    assert (bled(picture, alpha) != wanted).mean() <= FEW
