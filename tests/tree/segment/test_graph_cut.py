"""GraphCutFoliage on drawn trees of known mattes in difficult colours, and on the ground truth where it is there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from forestgen.arrays import stage_rng
from forestgen.errors import StageError
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo, load_photo
from forestgen.tree.segment import working_size
from forestgen.tree.segment.graph_cut import GraphCutFoliage
from forestgen.tree.strokes import load_strokes
from tests.tree.segment import scenes


def segment(scene: scenes.Scene, seed: int = 0, **settings: object) -> Mattes:
    method = GraphCutFoliage(**settings)  # type: ignore[arg-type]
    return method(scene.photo, scene.strokes, rng=np.random.default_rng(seed))


COLOURS = {
    "summer": {},
    "white blossom": {"leaf": (235, 230, 228), "sky": (110, 160, 220)},
    "autumn yellow before a field": {"leaf": (205, 160, 50), "grass": (190, 165, 90)},
    "silhouette": {"leaf": (25, 25, 28), "bark": (25, 25, 28), "sky": (150, 110, 120)},
    "black and white": {"leaf": (60, 60, 60), "bark": (40, 40, 40), "sky": (190, 190, 190), "grass": (120, 120, 120)},
    "overexposed sky": {"sky": (250, 250, 250)},
    "dark red": {"leaf": (80, 25, 35)},
}


@pytest.mark.parametrize("name", COLOURS)
def test_the_tree_is_found_in_any_colours(name: str) -> None:
    scene = scenes.leafy(**COLOURS[name])  # type: ignore[arg-type]
    mattes = segment(scene)
    assert scenes.overlap(mattes.is_tree, scene.is_tree) > 0.93
    assert not mattes.is_bare
    below = scene.is_wood & (np.arange(scenes.H)[:, None] > 290)
    assert scenes.overlap(mattes.is_branch[290:], below[290:]) > 0.9


def test_wood_between_leaves_is_branch_and_leaves_are_not() -> None:
    scene = scenes.leafy()
    mattes = segment(scene)
    assert scenes.overlap(mattes.is_branch, scene.is_wood) > 0.85
    assert scenes.overlap(mattes.is_foliage, scene.is_leaf) > 0.9


def test_the_papers_rule_finds_green_and_misses_grey() -> None:
    settings = {"rule": "green_red", "smoothness": 60.0, "guard": 1.0}
    green, grey = scenes.leafy(), scenes.leafy(**COLOURS["black and white"])  # type: ignore[arg-type]
    assert scenes.overlap(segment(green, **settings).is_foliage, green.is_leaf) > 0.75
    by_paper = scenes.overlap(segment(grey, **settings).is_foliage, grey.is_leaf)
    assert by_paper + 0.1 < scenes.overlap(segment(grey).is_foliage, grey.is_leaf)


def test_a_bare_tree_has_no_leaf_and_all_its_twigs() -> None:
    scene = scenes.bare()
    mattes = segment(scene)
    assert mattes.is_bare
    assert scenes.overlap(mattes.is_branch, scene.is_wood) > 0.85
    assert segment(scenes.leafy(), bare="yes").is_bare


def test_nothing_of_the_tree_lies_below_its_root_or_far_outside() -> None:
    scene = scenes.leafy()
    mattes = segment(scene)
    assert not mattes.is_tree[int(scenes.ROOT[1]) + 1 :].any()
    y, x = np.nonzero(mattes.is_tree[: scenes.GROUND - 40])
    assert np.hypot(x - scenes.CENTRE[0], y - scenes.CENTRE[1]).max() < scenes.CROWN_RADIUS + 20


def test_mattes_do_not_claim_a_pixel_twice_and_are_soft_at_edges() -> None:
    mattes = segment(scenes.leafy())
    assert (mattes.foliage + mattes.branch).max() <= 1 + 1e-6
    soft = (mattes.foliage > 0.05) & (mattes.foliage < 0.95)
    assert 0.01 < soft.sum() / mattes.is_foliage.sum() < 0.6


def test_same_seed_same_bytes_and_inputs_unchanged() -> None:
    scene = scenes.leafy()
    before = scene.photo.rgb.copy()
    a, b, c = segment(scene, 3), segment(scene, 3), segment(scene, 4)
    assert_array_equal(a.foliage, b.foliage)
    assert_array_equal(a.branch, b.branch)
    assert_array_equal(scene.photo.rgb, before)
    assert scenes.overlap(a.is_tree, c.is_tree) > 0.97  # another seed draws other samples, not another tree


def test_large_photos_are_segmented_smaller(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scenes.leafy()
    monkeypatch.setattr(working_size, "MOST_PIXELS", scene.photo.rgb[..., 0].size // 3)
    mattes = segment(scene)
    assert mattes.foliage.shape == scene.is_tree.shape
    assert scenes.overlap(mattes.is_tree, scene.is_tree) > 0.85


def test_a_plain_picture_has_no_tree() -> None:
    plain = Photo(np.full((scenes.H, scenes.W, 3), 128, np.uint8), "plain.png")
    drawn = scenes.strokes(branches=(np.array([[180.0, 380], [180, 379]]),))
    with pytest.raises(StageError, match="nothing in the crown differs"):
        GraphCutFoliage()(plain, drawn, rng=np.random.default_rng(0))


def test_a_crown_that_fills_the_photo_leaves_nothing_to_compare_with() -> None:
    scene = scenes.leafy()
    whole = np.array([[0.0, 0], [scenes.W, 0], [scenes.W, scenes.H], [0, scenes.H]])
    with pytest.raises(StageError, match="no background is left"):
        segment(replace(scene, strokes=scenes.strokes(crown=whole)))


@pytest.mark.parametrize(
    ("tree", "least_tree", "least_wood"),
    [("cherry_pink", 0.88, 0.8), ("aspen_narrow", 0.88, 0.65), ("oak_winter", 0.88, 0.95)],
)
def test_ground_truth(shared: Path, tree: str, least_tree: float, least_wood: float) -> None:
    folder = shared / "ground_truth" / tree
    truth = cv2.imread(str(folder / "photo_az000_mask.png"))[..., ::-1]
    photo, drawn = load_photo(folder / "photo_az000.jpg"), load_strokes(folder / "strokes_az000.json")
    mattes = GraphCutFoliage()(photo, drawn, rng=stage_rng(0, "segment", 0))
    assert scenes.overlap(mattes.is_tree, truth[..., 0].astype(int) + truth[..., 1] >= 128) > least_tree
    assert near_share(truth[..., 1] >= 128, mattes.is_branch) > least_wood
    assert mattes.is_bare == (tree == "oak_winter")


def near_share(truth: np.ndarray, found: np.ndarray, within: float = 2.0) -> float:
    """F-score of a thin mask with a tolerance in px."""
    to_truth, to_found = (cv2.distanceTransform((~m).astype(np.uint8), cv2.DIST_L2, 5) for m in (truth, found))
    precision, recall = (to_truth[found] <= within).mean(), (to_found[truth] <= within).mean()
    return float(2 * precision * recall / max(precision + recall, 1e-9))
