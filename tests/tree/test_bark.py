"""Bark: the trunk's own colours, evenly lit, in a tile without edges; plain where little is seen."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.tree.bark import BarkFromPhoto
from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo, load_photo
from forestgen.tree.quilting import enlarge, least_path, quilt, resize_torus, sewn_mask, valid_places
from forestgen.tree.strokes import Strokes, load_strokes
from forestgen.tree.trunk_strip import evenly_lit, extents, looks_like, trunk_outline, trunk_strip
from forestgen.tree.view import View

BROWN = np.array([110, 85, 60])
PX_PER_METRE = 100.0


def trunk_view(
    *, half_width: float = 30, lean: float = 0.0, leaves: bool = False, shading: bool = True, seed: int = 0
) -> View:
    """A round trunk on a lawn, its axis from (150, 380) up to (150 + lean, 20), in a 300 x 400 photo."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:400, :300] + 0.5
    axis = 150 + lean * (380 - y) / 360
    across = (x - axis) / half_width
    is_wood = (np.abs(across) < 1) & (y < 380)
    grain = cv2.GaussianBlur(rng.normal(0, 60, (400, 300)).astype(np.float32), (0, 0), 1.2)
    rgb = np.empty((400, 300, 3))
    rgb[:] = [70, 140, 50]
    light = 1 + 0.35 * np.clip(across, -1, 1) * shading
    rgb[is_wood] = ((BROWN + grain[..., None]) * light[..., None])[is_wood]
    foliage = np.zeros((400, 300), np.float32)
    if leaves:
        foliage[60:160, 100:200] = 1
        rgb[60:160, 100:200] = [30, 200, 30]
    path = np.array([[150, 380], [150 + lean / 2, 200], [150 + lean, 20]], float)
    strokes = Strokes(np.array([[100, 20], [200, 20], [150, 60]], float), (path,), size=(300, 400))
    return View(
        Photo(np.clip(rgb, 0, 255).astype(np.uint8), "trunk.png"),
        strokes,
        Mattes(foliage, is_wood.astype(np.float32) * (1 - foliage)),
        BranchGraph(path, np.array([-1, 0, 1]), np.full(3, np.nan)),
        Camera((300, 400), (150.0, 380.0), PX_PER_METRE),
    )


def without_wood(view: View) -> View:
    empty = np.zeros_like(view.mattes.branch)
    return View(view.photo, view.strokes, Mattes(empty, empty), view.branches, view.camera)


def jump(tile: NDArray[np.generic], axis: int) -> tuple[float, float]:
    """Mean step across the tile's edge, and the mean step between its own neighbouring rows or columns."""
    values = np.moveaxis(np.asarray(tile, float), axis, 0)
    return float(np.abs(values[0] - values[-1]).mean()), float(np.abs(np.diff(values, axis=0)).mean())


@pytest.mark.parametrize("lean", [0.0, 60.0])
def test_the_trunk_is_found_beside_its_stroke(lean: float) -> None:
    view = trunk_view(half_width=24, lean=lean)
    centre, normal, half = trunk_outline(view)
    expected = 150 + lean * (380 - centre[:, 1]) / 360
    inner = slice(20, -20)
    assert_allclose(centre[inner, 0], expected[inner], atol=1.0)
    slant = np.cos(np.arctan2(lean, 360))
    assert_allclose(half[inner], 24 * slant, atol=1.0)
    assert np.all(normal[:, 0] > 0.9)  # to the right


def test_extents_by_hand() -> None:
    #                     -3 -2 -1  0  1  2  3
    is_wood = np.array([[0, 1, 1, 1, 1, 0, 1], [0, 0, 0, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0, 0]], bool)
    left, right = extents(is_wood, np.arange(-3, 4))
    assert_array_equal(left, [-2.5, 0, 0])  # the last row's wood lies too far from the stroke
    assert_array_equal(right, [1.5, 0, 0])


def test_the_strip_is_upright_and_leaves_are_no_bark() -> None:
    strip = trunk_strip(trunk_view(leaves=True), np.deg2rad(56), 256)
    share = strip.is_bark.mean(axis=1)
    leafy = slice(50, 130)  # rows from the top: the trunk ends at row 20 of the photo, leaves at 160
    assert share[leafy].max() == 0
    assert share[170:330].min() > 0.9
    assert strip.radius == pytest.approx(30, abs=1)


def test_shading_across_the_trunk_is_taken_out() -> None:
    strip = trunk_strip(trunk_view(), np.deg2rad(56), 256)
    even = evenly_lit(strip, 0.22)

    def slope(rgb: NDArray[np.float32]) -> float:
        profile = rgb.mean(axis=(0, 2))
        return float((profile[-5:].mean() - profile[:5].mean()) / profile.mean())

    assert slope(strip.rgb) > 0.3
    assert abs(slope(even.rgb)) < 0.05


def test_bark_tiles_both_ways_has_the_trunks_colour_and_size() -> None:
    bark = BarkFromPhoto()([trunk_view()], rng=np.random.default_rng(0))
    assert bark.rgb.shape[1] >= 256
    for axis in (0, 1):
        edge, inside = jump(bark.rgb, axis)
        assert edge < 1.5 * inside + 0.5
    assert_allclose(bark.rgb.mean(axis=(0, 1)), BROWN, atol=6)
    assert bark.rgb.std() > 5  # it shows the grain
    assert bark.width_m == pytest.approx(np.pi * 30 / PX_PER_METRE, rel=0.25)
    assert bark.height_m / bark.width_m == pytest.approx(bark.rgb.shape[0] / bark.rgb.shape[1], rel=0.15)


def test_bark_is_not_mirrored_nor_a_repeated_patch() -> None:
    rgb = BarkFromPhoto(detail=0.0)([trunk_view()], rng=np.random.default_rng(0)).rgb.astype(float).mean(axis=2)
    fine = rgb - cv2.blur(rgb, (31, 31))

    def likeness(other: NDArray[np.float64]) -> float:
        return float(np.corrcoef(fine.ravel(), other.ravel())[0, 1])

    assert max(abs(likeness(np.roll(fine[:, ::-1], s, axis=1))) for s in range(0, 256, 4)) < 0.3
    for shift in ((128, 0), (0, 64), (256, 0), (0, 128), (256, 128)):
        assert abs(likeness(np.roll(fine, shift, axis=(0, 1)))) < 0.35


def test_sky_taken_for_wood_does_not_get_into_the_bark() -> None:
    view = trunk_view()
    branch = view.mattes.branch.copy()
    rgb = view.photo.rgb.copy()
    rgb[:, :135] = [150, 190, 250]
    branch[40:380, 110:135] = 1
    wrong = View(Photo(rgb, "sky.png"), view.strokes, Mattes(view.mattes.foliage, branch), view.branches, view.camera)
    bark = BarkFromPhoto()([wrong], rng=np.random.default_rng(0))
    mean = bark.rgb.mean(axis=(0, 1))
    assert mean[0] > mean[2]  # brown, not blue


def test_looks_like_allows_for_light_and_refuses_another_hue() -> None:
    known = np.array([[110, 85, 60]] * 20 + [[100, 78, 55]] * 20, np.uint8)
    row = np.array([[[110, 85, 60]] * 5, [[80, 60, 42]] * 5, [[60, 150, 50]] * 5, [[150, 190, 250]] * 5], np.float32)
    same = [looks_like(np.repeat(patch[None], 5, axis=0), known)[2, 2] for patch in row]
    assert same == [True, True, False, False]


@pytest.mark.parametrize("half_width", [1.0, 3.0])
def test_a_trunk_of_few_pixels_gives_its_plain_colour(half_width: float) -> None:
    bark = BarkFromPhoto()([trunk_view(half_width=half_width, shading=False)], rng=np.random.default_rng(0))
    assert bark.rgb.shape == (1, 1, 3)
    assert_allclose(bark.rgb[0, 0], BROWN, atol=12)


def test_a_matte_without_wood_gives_the_strokes_colour() -> None:
    bark = BarkFromPhoto()([without_wood(trunk_view(shading=False))], rng=np.random.default_rng(0))
    assert bark.rgb.shape == (1, 1, 3)
    assert_allclose(bark.rgb[0, 0], BROWN, atol=12)


def test_a_stroke_of_one_spot_gives_plain_bark() -> None:
    view = trunk_view()
    strokes = Strokes(view.strokes.crown, (np.array([[150.0, 300.0], [150.0, 300.0]]),), size=(300, 400))
    short = View(view.photo, strokes, view.mattes, view.branches, view.camera)
    assert BarkFromPhoto()([short], rng=np.random.default_rng(0)).rgb.shape == (1, 1, 3)


def test_the_view_that_shows_more_bark_is_taken() -> None:
    views = [without_wood(trunk_view()), trunk_view()]
    a = BarkFromPhoto()(views, rng=np.random.default_rng(0))
    b = BarkFromPhoto()(views[1:], rng=np.random.default_rng(0))
    assert_array_equal(a.rgb, b.rgb)


def test_same_seed_same_bark_other_seed_another() -> None:
    a, b, c = (BarkFromPhoto()([trunk_view()], rng=np.random.default_rng(s)).rgb for s in (4, 4, 5))
    assert a.tobytes() == b.tobytes()
    assert a.tobytes() != c.tobytes()


def test_least_path_by_hand() -> None:
    cost = np.array([[9, 1, 9], [9, 9, 1], [9, 1, 9], [1, 9, 9]], np.float32)
    assert_array_equal(least_path(cost), [1, 2, 1, 0])


def test_a_seam_runs_through_the_overlap_only() -> None:
    difference = np.ones((12, 12), np.float32)
    difference[:, 2] = difference[2] = 0
    known = np.zeros((12, 12), bool)
    known[:, :4] = known[:3] = True
    new = sewn_mask(difference, known, 4, (True, True, False, False))
    assert_array_equal(new[~known], 1)
    assert new[5:, 0].max() < 0.4  # the old patch keeps its side of the cut
    assert new[6, 6] == 1


def test_valid_places_by_hand() -> None:
    is_valid = np.ones((4, 5), bool)
    is_valid[0, 0] = False
    assert_array_equal(valid_places(is_valid, 4), [[0, 1]])
    assert len(valid_places(is_valid, 5)) == 0


def test_quilting_takes_only_valid_colours() -> None:
    rng = np.random.default_rng(0)
    sample = rng.random((60, 40, 3)).astype(np.float32) * 0.5
    sample[20:30, 10:20] = 1.0
    is_valid = sample[..., 0] < 0.9
    tile = quilt(sample, is_valid, (4, 3), 9, 3, rng=rng)
    assert tile.shape == (24, 18, 3)
    assert tile.max() <= 0.5


def test_quilting_says_when_it_cannot() -> None:
    sample = np.zeros((10, 10, 3), np.float32)
    with pytest.raises(ValueError, match="0 places"):
        quilt(sample, np.zeros((10, 10), bool), (3, 3), 5, 2, rng=np.random.default_rng(0))


def test_enlarging_keeps_the_tile_a_tile_and_its_colours() -> None:
    tile = np.random.default_rng(0).random((20, 10, 3)).astype(np.float32)
    large = enlarge(tile, (512, 256), 0.5)
    assert large.shape == (512, 256, 3)
    assert_allclose(large.mean(axis=(0, 1)), tile.mean(axis=(0, 1)), atol=0.01)
    for axis in (0, 1):
        edge, inside = jump(large, axis)
        assert edge < 2 * inside
    rolled = resize_torus(np.roll(tile, 5, axis=1), (40, 20))
    assert_allclose(rolled, np.roll(resize_torus(tile, (40, 20)), 10, axis=1), atol=1e-5)


@pytest.mark.parametrize("tree", ["oak_summer", "aspen_narrow", "pine_medium", "maple_autumn"])
def test_barks_of_true_trees_have_the_trunks_colour(shared: Path, tree: str) -> None:
    folder = shared / "ground_truth" / tree
    photo, strokes = load_photo(folder / "photo_az000.jpg"), load_strokes(folder / "strokes_az000.json")
    mask = cv2.imread(str(folder / "photo_az000_mask.png"))[:, :, ::-1].astype(np.float32) / 255
    graph = BranchGraph(np.array([strokes.root]), np.array([-1]), np.array([np.nan]))
    camera = Camera(photo.size, (float(strokes.root[0]), float(strokes.root[1])), 80.0)
    view = View(photo, strokes, Mattes(mask[..., 0], mask[..., 1]), graph, camera)
    bark = BarkFromPhoto()([view], rng=np.random.default_rng(0))
    assert bark.rgb.shape[1] >= 256
    strip = trunk_strip(view, np.deg2rad(56), 256)
    assert_allclose(bark.rgb.mean(axis=(0, 1)), strip.rgb[strip.is_bark].mean(axis=0) * 255, atol=6)
    for axis in (0, 1):
        edge, inside = jump(bark.rgb, axis)
        assert edge < 1.5 * inside + 0.5
