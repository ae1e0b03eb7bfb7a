"""Light taken out of leaf colours: known light painted in is gone, known colour stays."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from forestgen.tree.atlas_packing import bleed
from forestgen.tree.delight import delit
from forestgen.tree.leaf_colours import lab_of
from forestgen.tree.model import Atlas
from forestgen.tree.season_colours import reflectance
from forestgen.tree.srgb import LUMINANCE, bytes_from_linear, linear_from_bytes
from tests.tree.season_atlases import CELL, GREEN, ORANGE, PINK, cell_lab, hue, painted_atlas

N = 8


def lit(colour: tuple[float, float, float], light: NDArray[np.float64]) -> Atlas:
    """Leaves of one colour, each under its own light (N,), with a broad shadow over half of it."""
    atlas = painted_atlas([colour] * len(light))
    linear = linear_from_bytes(atlas.rgba[..., :3]) * np.repeat(light, CELL)[None, :, None]
    linear *= (0.6 + 0.4 * np.linspace(0, 1, CELL))[:, None, None]
    rgba = atlas.rgba.copy()
    rgba[..., :3] = bytes_from_linear(linear)
    return Atlas(bleed(rgba), atlas.prototypes)


def luminance(rgba: NDArray[np.uint8]) -> NDArray[np.float64]:
    return np.asarray(linear_from_bytes(rgba[..., :3]) @ LUMINANCE)


@pytest.mark.parametrize("colour", [GREEN, ORANGE])
def test_light_between_leaves_goes(colour: tuple[float, float, float]) -> None:
    atlas = lit(colour, np.geomspace(0.15, 1.2, N))
    old, new = cell_lab(atlas.rgba), cell_lab(delit(atlas))
    assert new[:, 0].std() < 0.3 * old[:, 0].std()


def test_the_shadow_across_a_leaf_goes_and_its_grain_stays() -> None:
    atlas = lit(GREEN, np.ones(3))
    out = delit(atlas)

    def slope_and_grain(rgba: NDArray[np.uint8]) -> tuple[float, float]:
        light = np.log(luminance(rgba)[:, CELL // 2 - 8 : CELL // 2 + 8])[12:52]
        rows = light.mean(axis=1)
        slope = np.polyfit(np.arange(40), rows, 1)
        return float(abs(slope[0]) * 40), float((light - np.polyval(slope, np.arange(40))[:, None]).std())

    (slope, grain), (flat, kept) = slope_and_grain(atlas.rgba), slope_and_grain(out)
    assert flat < 0.35 * slope
    assert kept > 0.5 * grain


@pytest.mark.parametrize("colour", [GREEN, ORANGE, PINK])
def test_the_hue_stays_and_the_exposure_is_a_leaf_s(colour: tuple[float, float, float]) -> None:
    atlas = lit(colour, np.geomspace(0.3, 1.0, N))
    out = delit(atlas)
    assert np.abs(hue(cell_lab(out)) - hue(np.array(colour))).max() < 8
    opaque = out[..., 3] == 255
    assert luminance(out)[opaque].mean() == pytest.approx(reflectance(np.array(colour)), rel=0.1)
    assert luminance(out).max() < 0.8


def test_two_exposures_of_one_crown_give_one_colour() -> None:
    dark, bright = (delit(lit(GREEN, light * np.geomspace(0.3, 1.0, N))) for light in (0.5, 1.1))
    assert np.abs(cell_lab(dark) - cell_lab(bright)).max() < 2.0


def test_the_matte_stays_and_bare_trees_are_refused() -> None:
    atlas = lit(GREEN, np.geomspace(0.3, 1.0, N))
    out = delit(atlas)
    assert_array_equal(out[..., 3], atlas.rgba[..., 3])
    assert_array_equal(out, bleed(out))
    assert_array_equal(out, delit(atlas))
    with pytest.raises(ValueError, match="bare tree has no leaf colour"):
        delit(Atlas(np.zeros((1, 1, 4), np.uint8), ()))


def test_black_leaves_do_not_turn_to_noise() -> None:
    atlas = lit(GREEN, np.array([0.004, 0.02, 0.5, 1.0]))
    lab = lab_of(delit(atlas)[..., :3])
    assert np.isfinite(lab).all()
    black = lab[:, :CELL][atlas.rgba[:, :CELL, 3] == 255]
    assert np.hypot(*(black[:, 1:] - np.array(GREEN)[1:]).T).max() < 25  # near the crown's colour, no coloured specks
