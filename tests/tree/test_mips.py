"""Mips: coverage is kept on every level, by alpha and by threshold alike."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from forestgen.tree.mips import THRESHOLD, build_mips, halve, scale_alpha, threshold_for, write_mips
from tests.tree.season_atlases import GREEN, ORANGE, painted_atlas


def needles(size: int = 256) -> NDArray[np.uint8]:
    """Slanting lines 2 px wide, 10 px apart: what plain mips lose first."""
    y, x = np.mgrid[:size, :size]
    alpha = np.clip(1.5 - np.abs((x + 0.6 * y) % 10 - 5), 0, 1)
    rgba = np.full((size, size, 4), 90, np.uint8)
    rgba[..., 3] = np.round(255 * alpha)
    return rgba


def test_levels_halve_down_to_one_texel() -> None:
    mips = build_mips(np.zeros((8, 32, 4), np.uint8))
    assert [image.shape[:2] for image in mips.kept] == [(8, 32), (4, 16), (2, 8), (1, 4), (1, 2), (1, 1)]
    assert build_mips(np.zeros((1, 1, 4), np.uint8)).thresholds.tolist() == [THRESHOLD]


def test_a_level_is_the_mean_of_four() -> None:
    image = np.arange(2 * 4 * 3, dtype=np.float32).reshape(2, 4, 3)
    want = image.reshape(1, 2, 2, 2, 3).mean(axis=(1, 3))
    assert_allclose(halve(image), want)


@pytest.mark.parametrize("rgba", [needles(), painted_atlas([GREEN, ORANGE]).rgba], ids=["needles", "leaves"])
def test_no_threshold_keeps_coverage_better(rgba: NDArray[np.uint8]) -> None:
    mips = build_mips(rgba)
    assert_array_equal(mips.kept[0], rgba)
    level = np.asarray(rgba[..., 3] / np.float32(255), np.float32)
    for k in range(1, len(mips.kept)):
        level = halve(level)
        assert mips.coverage[k] == (mips.kept[k][..., 3] >= THRESHOLD * 255).mean()
        possible = np.array([(level >= value).mean() for value in np.unique(level)])
        assert abs(mips.coverage[k] - mips.coverage[0]) <= np.abs(possible - mips.coverage[0]).min() + 1e-9


def test_plain_mips_lose_needles() -> None:
    mips = build_mips(needles())
    assert mips.plain_coverage[3] < 0.2 * mips.coverage[0]
    assert mips.coverage[3] > 0.85 * mips.coverage[0]


def test_the_threshold_on_plain_levels_has_the_same_effect() -> None:
    rgba = painted_atlas([GREEN, ORANGE]).rgba
    mips = build_mips(rgba)
    level = np.asarray(rgba[..., 3] / np.float32(255), np.float32)
    for k in range(1, len(mips.kept)):
        level = halve(level)
        assert_array_equal(level >= mips.thresholds[k], mips.kept[k][..., 3] >= THRESHOLD * 255)


def test_thresholds_by_hand() -> None:
    alpha = np.array([[0.9, 0.4], [0.2, 0.1]], np.float32)
    assert threshold_for(alpha, 0.5) == pytest.approx(0.3)  # two of four: between 0.4 and 0.2
    assert threshold_for(alpha, 0.25) == pytest.approx(0.65)
    assert threshold_for(alpha, 1.0) == pytest.approx(0.05)
    assert threshold_for(alpha, 0.01) == pytest.approx(0.65)  # one stays
    tied = np.array([[0.4, 0.4, 0.4, 0.1]], np.float32)
    assert threshold_for(tied, 0.6) == pytest.approx(0.25)  # three of four are nearer than none, and than four
    assert threshold_for(alpha, 0.0) == 1.0
    assert_array_equal(scale_alpha(alpha, 0.3), [[255, 170], [85, 42]])


def test_colour_is_averaged_in_linear_light_and_by_alpha() -> None:
    rgba = np.zeros((2, 2, 4), np.uint8)
    rgba[0, 0], rgba[0, 1] = (255, 0, 0, 255), (0, 0, 0, 255)
    rgba[1, :] = (0, 255, 0, 0)  # not there
    mean = build_mips(rgba).kept[1][0, 0]
    assert mean[0] == pytest.approx(188, abs=2)  # half of the light is 188 of 255, not 128
    assert mean[1] < 25


def test_empty_and_full_stay_so() -> None:
    empty, full = np.zeros((16, 16, 4), np.uint8), np.full((16, 16, 4), 255, np.uint8)
    assert_array_equal(build_mips(empty).coverage, 0)
    assert_array_equal(build_mips(full).coverage, 1)
    assert_array_equal(build_mips(full).kept[-1], 255)


def test_written_levels_are_those_below_the_texture(tmp_path: Path) -> None:
    mips = build_mips(painted_atlas([GREEN]).rgba)
    paths = write_mips(mips, tmp_path, "leaf")
    assert [path.name for path in paths] == [f"leaf_mip{k}.png" for k in range(1, 7)]
    for path, image in zip(paths, mips.kept[1:], strict=True):
        stored = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert stored is not None
        assert_array_equal(stored[..., [2, 1, 0, 3]], image)
    first = [path.read_bytes() for path in paths]
    assert [path.read_bytes() for path in write_mips(mips, tmp_path, "leaf")] == first
