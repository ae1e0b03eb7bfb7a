"""Seasons: leaves take on the season's colours and keep their light; the right ones fall."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.atlas_cells import cell_boxes, find_cells
from forestgen.tree.atlas_packing import SOLID, bleed
from forestgen.tree.leaf_colours import lab_of
from forestgen.tree.model import Atlas, Leaves
from forestgen.tree.season_colours import IS_GREEN, IS_NEITHER, IS_TURNED, classify, leaf_light, reflectance
from forestgen.tree.seasons import FALLEN, GREEN_LEFT, SEASONS, fallen, season_atlas, seasons_of
from forestgen.tree.srgb import LUMINANCE
from tests.tree.season_atlases import CELL, GREEN, ORANGE, PINK, cell_lab, hue, painted_atlas
from tests.usd.models import tree_model


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def shades(colour: tuple[float, float, float], n: int) -> list[tuple[float, float, float]]:
    """n leaves of one hue, from the crown's shade to its sun."""
    return [tuple(np.array(colour) * f) for f in np.linspace(0.5, 1.3, n)]


def crown(n: int = 4000) -> Leaves:
    """Leaves anywhere in a ball of radius 2 m around (0, 5, 0)."""
    r = rng(5)
    at = r.normal(size=(n, 3))
    at *= 2 * r.uniform(0, 1, (n, 1)) ** (1 / 3) / np.linalg.norm(at, axis=1, keepdims=True)
    turn = np.tile([1.0, 0, 0, 0], (n, 1))
    return Leaves(at + np.array([0.0, 5.0, 0.0]), turn, np.full(n, 0.1), np.zeros(n, np.int64))


def test_a_cell_worn_twice_is_one_cell_and_each_texel_falls_to_its_own() -> None:
    atlas = painted_atlas([GREEN, ORANGE, PINK], twice=True)
    cells = find_cells(atlas)
    assert len(cell_boxes(atlas)) == cells.n == 3
    assert_array_equal(cells.of, cells.column // CELL)
    assert len(cells.row) == (atlas.rgba[..., 3] >= SOLID * 255).sum()


@pytest.mark.parametrize(("colour", "kind"), [(GREEN, IS_GREEN), (ORANGE, IS_TURNED), (PINK, IS_NEITHER)])
def test_leaves_are_told_by_their_colour_in_sun_and_shade(colour: tuple[float, float, float], kind: int) -> None:
    assert_array_equal(classify(np.array(shades(colour, 7))), kind)


@pytest.mark.parametrize("season", ["summer", "autumn", "winter"])
@pytest.mark.parametrize("evergreen", [False, True])
def test_the_matte_stays_and_the_colour_is_bled_as_before(season: str, evergreen: bool) -> None:
    atlas = painted_atlas(shades(GREEN, 4) + shades(ORANGE, 4))
    out = season_atlas(atlas, season, evergreen=evergreen, rng=rng())  # type: ignore[arg-type]
    assert out.shape == atlas.rgba.shape
    assert out.dtype == np.uint8
    assert_array_equal(out[..., 3], atlas.rgba[..., 3])
    assert_array_equal(out, bleed(out))


@pytest.mark.parametrize(("season", "colour"), [("summer", GREEN), ("autumn", ORANGE)])
def test_an_atlas_that_shows_the_season_keeps_every_texel(season: str, colour: tuple[float, float, float]) -> None:
    atlas = painted_atlas(shades(colour, 6))
    assert_array_equal(season_atlas(atlas, season, rng=rng()), atlas.rgba)  # type: ignore[arg-type]


@pytest.mark.parametrize("colour", [ORANGE, PINK])
def test_in_summer_all_leaves_are_green_and_keep_their_order_of_light(colour: tuple[float, float, float]) -> None:
    atlas = painted_atlas(shades(colour, 8))
    lab = cell_lab(season_atlas(atlas, "summer", rng=rng()))
    assert_array_equal(classify(lab), IS_GREEN)
    assert np.all((hue(lab) > 100) & (hue(lab) < 130))
    assert np.corrcoef(lab[:, 0], cell_lab(atlas.rgba)[:, 0])[0, 1] > 0.98
    assert lab[:, 0].mean() < cell_lab(atlas.rgba)[:, 0].mean()  # a green leaf is darker than an orange one or petals


@pytest.mark.parametrize("colour", [GREEN, PINK])
def test_autumn_mixes_colours_between_yellow_and_russet_and_leaves_some_green(
    colour: tuple[float, float, float],
) -> None:
    lab = cell_lab(season_atlas(painted_atlas(shades(colour, 28)), "autumn", rng=rng()))
    kind = classify(lab)
    turned = hue(lab[kind == IS_TURNED])
    assert len(turned) >= 0.6 * len(lab)
    assert round(GREEN_LEFT * len(lab)) <= (kind == IS_GREEN).sum() <= 0.4 * len(lab)
    assert turned.min() < 72 < 85 < turned.max()  # both orange and yellow ones
    assert np.hypot(lab[:, 1], lab[:, 2]).max() < 75  # no neon


def test_a_summer_photo_with_one_orange_leaf_turns_that_one_only() -> None:
    atlas = painted_atlas([*shades(GREEN, 5), ORANGE])
    out = season_atlas(atlas, "summer", rng=rng())
    green, orange = np.s_[:, : 5 * CELL - 4], np.s_[:, 5 * CELL + 4 :]
    assert_array_equal(out[green], atlas.rgba[green])
    assert classify(cell_lab(out))[5] == IS_GREEN
    assert np.abs(out[orange].astype(int) - atlas.rgba[orange]).max() > 20


def test_an_autumn_photo_keeps_the_leaves_that_are_green_still() -> None:
    atlas = painted_atlas([*shades(ORANGE, 5), GREEN])
    assert_array_equal(season_atlas(atlas, "autumn", rng=rng()), atlas.rgba)


def test_the_texture_within_a_leaf_stays() -> None:
    atlas = painted_atlas(shades(GREEN, 8))
    out = season_atlas(atlas, "autumn", rng=rng())
    opaque = atlas.rgba[..., 3] == 255
    for k in range(8):
        part = np.zeros_like(opaque)
        part[:, k * CELL : (k + 1) * CELL] = True
        old, new = (lab_of(a[..., :3])[opaque & part][:, 0] for a in (atlas.rgba, out))
        assert np.corrcoef(old, new)[0, 1] > 0.75
        assert new.std() > 0.6 * old.std()


def test_a_leaf_turns_from_its_margin_inward() -> None:
    atlas = painted_atlas(shades(GREEN, 12))
    out = season_atlas(atlas, "autumn", rng=rng(3))
    angle = hue(lab_of(out[..., :3])).reshape(CELL, 12, CELL)
    middle, margin = angle[24:40, :, 28:36].mean(axis=(0, 2)), angle[24:40, :, 10:13].mean(axis=(0, 2))
    turned = classify(cell_lab(out)) == IS_TURNED
    assert turned.sum() >= 6
    assert np.mean(margin[turned] < middle[turned]) > 0.8


def test_trees_differ_in_autumn_and_one_tree_does_not() -> None:
    atlas = painted_atlas(shades(GREEN, 8))
    assert_array_equal(season_atlas(atlas, "autumn", rng=rng(1)), season_atlas(atlas, "autumn", rng=rng(1)))
    means = [cell_lab(season_atlas(atlas, "autumn", rng=rng(s))).mean(axis=0) for s in range(8)]
    assert np.ptp(hue(np.array(means))) > 5


def test_an_evergreen_is_the_same_all_year_but_darker_and_bluer_in_winter() -> None:
    atlas = painted_atlas(shades(GREEN, 6))
    for season in ("photo", "summer", "autumn"):
        assert_array_equal(season_atlas(atlas, season, evergreen=True, rng=rng()), atlas.rgba)
    old, new = cell_lab(atlas.rgba), cell_lab(season_atlas(atlas, "winter", evergreen=True, rng=rng()))
    assert np.all(new[:, 0] < old[:, 0] - 1.5)
    assert np.all(new[:, 0] > 0.8 * old[:, 0])
    assert np.all(new[:, 2] < old[:, 2])
    assert_array_equal(classify(new), IS_GREEN)


def test_winter_of_others_changes_no_colour_and_drops_all() -> None:
    atlas, leaves = painted_atlas([GREEN]), crown(50)
    assert_array_equal(season_atlas(atlas, "winter", rng=rng()), atlas.rgba)
    assert_array_equal(fallen(leaves, "winter", rng=rng()), np.arange(50))


def test_a_bare_tree_has_no_summer() -> None:
    assert seasons_of(tree_model(n_leaves=0)) == ("photo", "winter")
    assert seasons_of(tree_model()) == SEASONS == ("photo", "summer", "autumn", "winter")
    bare = Atlas(np.zeros((1, 1, 4), np.uint8), ())
    for season in ("summer", "autumn"):
        with pytest.raises(ValueError, match=f"bare tree has no leaves for {season}"):
            season_atlas(bare, season, rng=rng())
    assert_array_equal(season_atlas(bare, "winter", rng=rng()), bare.rgba)


def test_unknown_seasons_and_shares_are_refused() -> None:
    with pytest.raises(ValueError, match="'monsoon' is no season; expected one of photo, summer, autumn, winter"):
        season_atlas(painted_atlas([GREEN]), "monsoon", rng=rng())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="'spring' is no season"):
        fallen(crown(3), "spring", rng=rng())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"share is 1.5; expected 0 to 1"):
        fallen(crown(3), "autumn", share=1.5, rng=rng())


@pytest.mark.parametrize("season", ["photo", "summer"])
def test_nothing_falls_in_summer_nor_from_an_evergreen(season: str) -> None:
    assert not len(fallen(crown(), season, rng=rng()))  # type: ignore[arg-type]
    assert not any(len(fallen(crown(), s, evergreen=True, rng=rng())) for s in SEASONS)


@pytest.mark.parametrize("share", [0.0, FALLEN, 1.0])
def test_autumn_drops_its_share_once_each(share: float) -> None:
    ids = fallen(crown(), "autumn", share=share, rng=rng())
    assert len(ids) == round(share * 4000)
    assert np.all(np.diff(ids) > 0)
    assert_array_equal(ids, fallen(crown(), "autumn", share=share, rng=rng()))


def test_autumn_takes_the_top_and_the_outside_first() -> None:
    leaves = crown()
    gone = np.isin(np.arange(len(leaves)), fallen(leaves, "autumn", rng=rng()))
    at = leaves.position - [0, 5, 0]
    out, high = np.linalg.norm(at, axis=1) > 1.6, at[:, 1] > 0.8
    assert gone[out].mean() > 1.6 * gone[~out].mean()
    assert gone[high].mean() > 1.2 * gone[~high].mean()
    assert gone[~out].mean() > 0.05  # and some from within


def test_the_palette_brightens_to_yellow_and_darkens_to_brown() -> None:
    tint, gives = leaf_light(np.linspace(0, 1, 101))
    assert_allclose(tint @ LUMINANCE, 1, atol=1e-6)
    assert gives.argmax() == 34
    assert 0.05 < gives.min() < gives.max() < 0.45
    assert reflectance(np.array(GREEN)) < reflectance(np.array(ORANGE)) < reflectance(np.array(PINK))
    assert reflectance(0.5 * np.array(ORANGE)) == pytest.approx(reflectance(np.array(ORANGE)), rel=1e-6)  # by hue only
