"""Levels of detail measured against the full tree, read from a written one, and shown side by side."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.check.lod_sheet import CAPTION, TALL_PX, lod_sheet
from forestgen.check.lods import DrawnLevel, averaged, score_levels
from forestgen.errors import InputError
from forestgen.render import Drawable
from forestgen.render.model_drawables import level_drawables
from forestgen.tree.level import full_level
from forestgen.tree.lod import LOD_STEPS, coarser_level
from forestgen.tree.model import TreeModel
from forestgen.usd.extras import Extras
from forestgen.usd.lod_drawables import read_lod_drawables
from forestgen.usd.tree_asset import write_tree_asset
from tests.tree.lod_trees import bushy_tree


def drawn(model: TreeModel) -> list[DrawnLevel]:
    """The full tree and LOD1, LOD2."""
    levels = [full_level(model), *(coarser_level(model, step) for step in LOD_STEPS)]
    return [
        DrawnLevel(f"LOD{k}", level.switch_px, level_drawables(level, model.bark, model.atlas.rgba))
        for k, level in enumerate(levels)
    ]


def box(width: float, height: float, colour: tuple[float, float, float], name: str = "box") -> Drawable:
    """A box about the y axis, its foot on the ground."""
    x = np.array([-1.0, 1.0]) * width / 2
    points = np.array([[a, b, c] for a in x for b in (0.0, height) for c in x])
    quads = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    return Drawable(name=name, points=points, faces=np.array(faces), colour=np.array([*colour, 1.0]))


def level(*drawables: Drawable, size: float = 100.0, name: str = "LOD1") -> DrawnLevel:
    return DrawnLevel(name, size, drawables)


FULL = level(box(1.0, 4.0, (0.5, 0.4, 0.3)), size=math.inf, name="LOD0")


def test_a_level_that_is_the_tree_itself_scores_one() -> None:
    (score,) = score_levels([FULL, level(*FULL.drawables)])
    assert asdict(score) == {
        "level": "LOD1",
        "switch_px": 100.0,
        "triangles": 12,
        "instances": 0,
        "envelope_iou": 1.0,
        "envelope_iou_worst": 1.0,
        "colour_delta_e": 0.0,
    }


def test_a_level_that_is_narrower_scores_its_share_of_the_width() -> None:
    (score,) = score_levels([FULL, level(box(0.9, 4.0, (0.5, 0.4, 0.3)))])
    assert score.envelope_iou == pytest.approx(0.9, abs=0.01)
    assert score.envelope_iou_worst <= score.envelope_iou


def test_a_level_that_overhangs_is_seen_in_full() -> None:
    (score,) = score_levels([FULL, level(box(2.0, 8.0, (0.5, 0.4, 0.3)))])
    # from the side a quarter; from 30 degrees above the tops show too
    above = (4 * math.cos(math.pi / 6) + 0.5) / (2 * (8 * math.cos(math.pi / 6) + 1.0))
    assert score.envelope_iou == pytest.approx((4 * 0.25 + above) / 5, abs=0.01)


def test_a_colour_that_shifts_is_told_in_delta_e() -> None:
    from skimage.color import deltaE_ciede2000, rgb2lab

    (score,) = score_levels([FULL, level(box(1.0, 4.0, (0.5, 0.45, 0.3)))])
    expected = deltaE_ciede2000(*(rgb2lab(np.array([[c]])) for c in ((0.5, 0.4, 0.3), (0.5, 0.45, 0.3)))).item()
    assert score.colour_delta_e == pytest.approx(expected, rel=0.03)
    assert score.envelope_iou == 1


def test_nothing_to_compare_gives_no_score_and_a_level_of_nothing_none_of_the_tree() -> None:
    nothing = level()
    assert score_levels([FULL]) == []
    assert score_levels([nothing, FULL]) == []
    (score,) = score_levels([FULL, nothing])
    assert (score.envelope_iou, score.colour_delta_e, score.triangles) == (0.0, 100.0, 0)


def test_cards_are_no_leaves() -> None:
    leaf = replace(box(0.1, 0.1, (0, 1, 0)), name="leaf_0", is_leaf=True, transforms=np.tile(np.eye(4), (7, 1, 1)))
    cards = replace(box(1.0, 4.0, (0, 1, 0)), name="/oak/geo/LOD3/leaf_cards", is_leaf=True)
    assert level(leaf, cards).n_instances == 7
    assert level(leaf, cards).n_triangles == 8 * 12


def test_colours_are_averaged_over_a_pixels_footprint_by_what_is_covered() -> None:
    rgba = np.zeros((9, 9, 4), np.uint8)
    rgba[4, 3] = [200, 0, 0, 255]
    rgba[4, 5] = [0, 100, 0, 255]
    assert_allclose(averaged(rgba, 3.0)[4, 4], np.array([100, 50, 0]) / 255, atol=1e-5)
    assert_allclose(averaged(rgba, 1.0)[4, 3], [200 / 255, 0, 0], atol=1e-5)


def test_levels_of_a_tree_keep_its_outline_and_colour() -> None:
    scores = score_levels(drawn(bushy_tree(3000)))
    assert [score.level for score in scores] == ["LOD1", "LOD2"]
    for score in scores:
        assert score.envelope_iou >= 0.98
        assert score.colour_delta_e <= 2


def test_levels_of_a_bare_tree_keep_its_outline() -> None:
    # twigs at random, with gaps that the envelope's disc bridges or not by a hair: each is 0.5 % of the crown
    first, second = score_levels(drawn(bushy_tree(0)))
    assert first.envelope_iou >= 0.985
    assert second.envelope_iou >= 0.97


def test_leaves_dropped_without_growing_are_found_out() -> None:
    model = bushy_tree(1500)
    coarse = coarser_level(model, LOD_STEPS[1])
    shrunk = replace(coarse, leaves=replace(coarse.leaves, size=coarse.leaves.size * 0.3))
    full = level(*level_drawables(full_level(model), model.bark, model.atlas.rgba), size=math.inf, name="LOD0")
    (score,) = score_levels([full, level(*level_drawables(shrunk, model.bark, model.atlas.rgba))])
    assert score.envelope_iou < 0.95


def test_the_levels_of_a_written_tree_are_those_that_were_written(tmp_path: Path) -> None:
    model = bushy_tree(300)
    levels = [coarser_level(model, step) for step in LOD_STEPS]
    path = write_tree_asset(model, tmp_path / "bush", Extras(levels=tuple(levels)))
    before = path.read_bytes()
    read = [DrawnLevel(*one) for one in read_lod_drawables(path)]
    assert [one.level for one in read] == ["LOD0", "LOD1", "LOD2"]
    assert [one.switch_px for one in read] == pytest.approx([math.inf, 400, 150], rel=1e-6)
    for one, written in zip(read, (full_level(model), *levels), strict=True):
        assert (one.n_triangles, one.n_instances) == (written.n_triangles, written.n_instances)
    assert path.read_bytes() == before
    alone = write_tree_asset(model, tmp_path / "alone")
    assert [one[0] for one in read_lod_drawables(alone)] == ["LOD0"]
    with pytest.raises(InputError, match=r"no\.usda"):
        list(read_lod_drawables(tmp_path / "no.usda"))


def test_a_sheet_shows_all_levels_at_one_size_and_each_switch_at_its_own() -> None:
    sheet = lod_sheet([FULL, level(*FULL.drawables, size=100.0)])
    assert sheet.dtype == np.uint8
    tall, small = round(1.1 * TALL_PX), 110
    assert sheet.shape[0] == pytest.approx(tall + small + 2 * CAPTION, abs=6)
    assert count_posts(sheet[tall // 2]) == 2
    assert count_posts(sheet[tall + CAPTION + small // 2]) == 2
    assert count_posts(sheet[tall + 2]) == 0


def count_posts(row: np.ndarray) -> int:
    """Stretches of a row of pixels (W, 3) that are brown, as the box is."""
    brown = row[:, 0].astype(int) - row[:, 2] > 30
    return int(np.count_nonzero(np.diff(brown.astype(int)) == 1))
