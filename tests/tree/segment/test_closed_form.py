"""ClosedFormMatte on drawn trees of known mattes, and the equation it solves on pictures of a few pixels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from forestgen.errors import StageError
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo, load_photo
from forestgen.tree.segment import trimap as strips
from forestgen.tree.segment.closed_form import ClosedFormMatte
from forestgen.tree.segment.trimap import BACKGROUND, TREE, UNKNOWN, solve_strip, trimap_of, unknown_alpha
from forestgen.tree.strokes import Strokes, load_strokes
from tests.tree.segment import scenes


def segment(scene: scenes.Scene, **settings: object) -> Mattes:
    method = ClosedFormMatte(**settings)  # type: ignore[arg-type]
    return method(scene.photo, scene.strokes, rng=np.random.default_rng(0))


def test_near_an_edge_all_is_unknown_but_where_somebody_is_sure() -> None:
    is_tree = np.zeros((1, 9), bool)
    is_tree[0, 3:] = True
    nowhere = np.zeros_like(is_tree)
    B, U, T = BACKGROUND, UNKNOWN, TREE
    assert_array_equal(trimap_of(is_tree, 1, nowhere, nowhere), [[B, B, U, U, T, T, T, T, T]])
    assert_array_equal(trimap_of(is_tree, 2, nowhere, nowhere), [[B, U, U, U, U, T, T, T, T]])
    tree, background = nowhere.copy(), nowhere.copy()
    tree[0, 3], background[0, 2] = True, True
    assert_array_equal(trimap_of(is_tree, 2, tree, background), [[B, U, B, T, U, T, T, T, T]])


def edge_picture(alpha: NDArray[np.float64]) -> NDArray[np.float32]:
    """Leaf over sky with the given cover (h, w)."""
    leaf, sky = np.array([0.2, 0.5, 0.15]), np.array([0.6, 0.7, 0.9])
    return (alpha[..., None] * leaf + (1 - alpha[..., None]) * sky).astype(np.float32)


def test_a_mixed_edge_is_unmixed() -> None:
    cover = np.broadcast_to([0, 0, 0, 0, 0.25, 0.75, 1, 1, 1, 1], (8, 10)).astype(float)
    trimap = np.where((cover > 0) & (cover < 1), UNKNOWN, cover)
    alpha = solve_strip(edge_picture(cover), trimap, np.zeros((8, 10), np.float32), 1e-4, 1e-7)
    assert_allclose(alpha, cover, atol=0.01)


def plain_alpha(
    rgb: NDArray[np.float32], trimap: NDArray[np.float64], nearby: NDArray[np.float32], pull: float, epsilon: float
) -> NDArray[np.float64]:
    """The oracle: the matting Laplacian of Levin et al. 2008, eq. 12, summed window by window, solved as it is."""
    h, w = trimap.shape
    index = np.arange(h * w).reshape(h, w)
    laplacian = np.zeros((h * w, h * w))
    for row in range(1, h - 1):
        for column in range(1, w - 1):
            at = index[row - 1 : row + 2, column - 1 : column + 2].ravel()
            colour = rgb.reshape(-1, 3)[at].astype(float)
            away = colour - colour.mean(axis=0)
            spread = np.linalg.inv(away.T @ away / 9 + epsilon / 9 * np.eye(3))
            laplacian[np.ix_(at, at)] += np.eye(9) - (1 + away @ spread @ away.T) / 9
    unknown = (trimap == UNKNOWN).ravel()
    known = trimap.ravel()[~unknown]
    left = laplacian[np.ix_(unknown, unknown)] + pull * np.eye(unknown.sum())
    right = pull * nearby.ravel()[unknown] - laplacian[np.ix_(unknown, ~unknown)] @ known
    alpha = trimap.ravel().copy()
    alpha[unknown] = np.linalg.solve(left, right)
    return np.clip(alpha, 0, 1).reshape(h, w)


@pytest.mark.parametrize("pull", [1e-4, 0.3, 5.0])
def test_the_library_solves_the_equation(pull: float) -> None:
    rng = np.random.default_rng(4)
    rgb = rng.random((9, 11, 3)).astype(np.float32)
    trimap = rng.choice([BACKGROUND, UNKNOWN, TREE], (9, 11), p=[0.2, 0.6, 0.2])
    nearby = rng.random((9, 11)).astype(np.float32)
    fast = solve_strip(rgb, trimap, nearby, pull, 1e-4)
    assert_allclose(fast, plain_alpha(rgb, trimap, nearby, pull, 1e-4), atol=2e-3)


def test_strips_give_what_the_whole_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scenes.leafy()
    rgb = scene.photo.rgb.astype(np.float32) / 255
    nowhere = np.zeros_like(scene.is_tree)
    trimap = trimap_of(scene.is_tree, 2, nowhere, nowhere)
    nearby = scene.is_tree.astype(np.float32)
    whole = unknown_alpha(rgb, trimap, nearby, 3.0, 1e-4)
    monkeypatch.setattr(strips, "STRIP_PIXELS", 1)  # a strip of the fewest rows
    assert_allclose(unknown_alpha(rgb, trimap, nearby, 3.0, 1e-4), whole, atol=0.01)


def test_a_trimap_without_unknown_pixels_is_its_own_matte() -> None:
    trimap = np.array([[0.0, 1.0, 1.0]])
    assert_array_equal(
        unknown_alpha(np.zeros((1, 3, 3), np.float32), trimap, np.zeros((1, 3), np.float32), 1, 1), trimap
    )


COLOURS = {
    "summer": {},
    "white blossom": {"leaf": (235, 230, 228), "sky": (110, 160, 220)},
    "silhouette": {"leaf": (25, 25, 28), "bark": (25, 25, 28), "sky": (150, 110, 120)},
    "black and white": {"leaf": (60, 60, 60), "bark": (40, 40, 40), "sky": (190, 190, 190), "grass": (120, 120, 120)},
}


@pytest.mark.parametrize("name", COLOURS)
def test_the_tree_is_found_in_any_colours(name: str) -> None:
    scene = scenes.leafy(**COLOURS[name])  # type: ignore[arg-type]
    mattes = segment(scene)
    assert scenes.overlap(mattes.is_tree, scene.is_tree) > 0.93
    assert not mattes.is_bare
    below = scene.is_wood & (np.arange(scenes.H)[:, None] > 290)
    assert scenes.overlap(mattes.is_branch[290:], below[290:]) > 0.9
    assert not mattes.is_tree[int(scenes.ROOT[1]) + 1 :].any()


def test_a_bare_tree_has_no_leaf() -> None:
    scene = scenes.bare()
    mattes = segment(scene)
    assert mattes.is_bare
    assert scenes.overlap(mattes.is_branch, scene.is_wood) > 0.85


def halved(scene: scenes.Scene) -> tuple[Photo, Strokes, NDArray[np.float32]]:
    """A scene photographed at half the size, with the share of each pixel that is tree."""
    size = (scenes.W // 2, scenes.H // 2)
    rgb = cv2.resize(scene.photo.rgb, size, interpolation=cv2.INTER_AREA)
    cover = cv2.resize(scene.is_tree.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    drawn = Strokes(scene.strokes.crown / 2, tuple(path / 2 for path in scene.strokes.branches), size=size)
    return Photo(np.asarray(rgb), "half.png"), drawn, np.asarray(cover)


def test_density_is_the_share_of_each_pixel_that_is_tree() -> None:
    photo, drawn, truth = halved(scenes.leafy())
    mattes = ClosedFormMatte()(photo, drawn, rng=np.random.default_rng(0))
    found = mattes.foliage + mattes.branch
    assert found.max() <= 1 + 1e-6
    mixed = (truth > 0.1) & (truth < 0.9)
    assert mixed.sum() > 500
    assert np.abs(found - truth)[mixed].mean() < 0.15  # a mask without soft edges is off by 0.3 there
    assert np.abs(found - truth).mean() < 0.02


def test_a_background_stroke_takes_pixels_out_of_the_crown() -> None:
    scene = scenes.leafy()
    through = np.array([[120.0, 120.0], [240.0, 120.0]])
    assert segment(scene).is_tree[120, 120:240].mean() > 0.2
    marked = replace(scene, strokes=replace(scene.strokes, background=(through,)))
    assert not segment(marked).is_tree[120, 125:165].any()


def test_a_crown_on_plain_sky_is_refused() -> None:
    scene = scenes.leafy()
    sky = Photo(np.full_like(scene.photo.rgb, 180), "sky.png")
    with pytest.raises(StageError, match="outline on the tree"):
        ClosedFormMatte()(sky, scene.strokes, rng=np.random.default_rng(0))


@pytest.mark.parametrize(("name", "value"), [("band", 0), ("pull", -1.0), ("epsilon", -1e-9)])
def test_settings_out_of_range_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} is {value}; expected at least"):
        ClosedFormMatte(**{name: value})  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "least", "most"), [("oak_winter", 0.92, 0.011)])
def test_known_trees_keep_their_mattes(shared: Path, name: str, least: float, most: float) -> None:
    folder = shared / "ground_truth" / name
    photo, strokes = load_photo(folder / "photo_az000.jpg"), load_strokes(folder / "strokes_az000.json")
    truth = cv2.imread(str(folder / "photo_az000_mask.png")).astype(np.float32)[..., 1:].sum(axis=2) / 255
    mattes = ClosedFormMatte()(photo, strokes, rng=np.random.default_rng(0))
    assert scenes.overlap(mattes.is_tree, truth >= 0.5) > least
    crown = strokes.crown.astype(int)
    box = np.s_[crown[:, 1].min() : crown[:, 1].max(), crown[:, 0].min() : crown[:, 0].max()]
    assert ((mattes.foliage + mattes.branch - truth)[box] ** 2).mean() < most
