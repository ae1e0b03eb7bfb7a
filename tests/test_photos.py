"""Real photographs and trees of known truth, from manifest to score: no version may fall behind an earlier one.

The floors in photo_floors.json are what was reached when they were last measured, by

    python benchmarks/fidelity.py --floors tests/photo_floors.json

Photographs and truth lie beside the checkout, in `shared`; without them these tests are skipped.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from statistics import fmean
from typing import Any

import pytest

from benchmarks.fidelity import photo_figures, photo_scenes, score_all, truth_figures, truth_scene
from forestgen.pipeline import build_scene
from forestgen.scene.manifest import load_scene
from forestgen.tree.photo import load_photo
from forestgen.tree.strokes import load_strokes

FLOORS: dict[str, dict[str, dict[str, float]]] = json.loads(Path(__file__).with_name("photo_floors.json").read_text())
AT_MOST = {"branch_chamfer", "colour_delta_e"}
SLACK = 0.01  # a figure may be worse by this share
ROUNDED = 1e-4  # figures are written with four decimals
JOBS = 2


def fallen_behind(figures: Mapping[str, float], floors: Mapping[str, float]) -> list[str]:
    """Which figures are worse than their floors, in words."""
    words = []
    for name, floor in floors.items():
        sign = -1 if name in AT_MOST else 1
        if sign * (figures[name] - floor) < -SLACK * abs(floor) - ROUNDED:
            words.append(f"{name} was {floor}, is {figures[name]}")
    return words


def test_a_fall_is_seen_and_a_rise_is_none() -> None:
    floors = {"skill": 0.5, "branch_chamfer": 0.01}
    assert fallen_behind({"skill": 0.496, "branch_chamfer": 0.0101}, floors) == []
    assert fallen_behind({"skill": 0.9, "branch_chamfer": 0.001}, floors) == []
    assert fallen_behind({"skill": 0.49, "branch_chamfer": 0.011}, floors) == [
        "skill was 0.5, is 0.49",
        "branch_chamfer was 0.01, is 0.011",
    ]


def test_manifests_of_real_photos_load(shared: Path) -> None:
    n_trees = {}
    for name in ("street", "woods", "roadside"):
        scene = load_scene(shared / "photos" / f"{name}.toml")
        n_trees[name] = len(scene.trees)
        for tree in scene.trees:
            (view,) = tree.views
            load_strokes(view.strokes, load_photo(view.photo).size)
    assert n_trees["street"] >= 8
    assert n_trees["woods"] in (3, 4)


@pytest.fixture(scope="module")
def photo_reports(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Reports of the trees with floors, by name."""
    out = tmp_path_factory.mktemp("photos")
    scenes = photo_scenes(shared, "tan2008", list(FLOORS["photos"]))
    reports = [build_scene(scene, out / scene.prim_name, jobs=JOBS) for scene in scenes]
    return {name: row for report in reports for name, row in photo_figures(report).items()}


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.parametrize("name", FLOORS["photos"])
def test_real_trees_match_their_photos_as_they_did(name: str, photo_reports: dict[str, Any]) -> None:
    assert fallen_behind(photo_reports[name], FLOORS["photos"][name]) == []


@pytest.fixture(scope="module")
def truth_scores(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """What the independent scorer says of the trees of known truth that have floors."""
    out = tmp_path_factory.mktemp("truth")
    scene = truth_scene(shared, "tan2008", list(FLOORS["truth"]))
    assert scene is not None
    build_scene(scene, out, jobs=JOBS)
    return score_all(shared, out, scene, JOBS)


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.parametrize("name", FLOORS["truth"])
def test_known_trees_come_as_near_to_the_truth_as_they_did(name: str, truth_scores: dict[str, Any]) -> None:
    assert fallen_behind(truth_figures(truth_scores)[name], FLOORS["truth"][name]) == []


@pytest.mark.slow
@pytest.mark.gl
def test_leafy_trees_reach_the_design_targets(truth_scores: dict[str, dict[str, Any]]) -> None:
    """DESIGN section 6: over the leafy trees; the bare one's twigs nobody can know."""
    leafy = [truth_scores[name] for name in ("aspen_narrow", "oak_summer")]
    assert fmean(row["views"]["photo_0"]["envelope_iou"] for row in leafy) >= 0.93
    assert fmean(row["views"]["photo_0"]["skill"] for row in leafy) >= 0.5
    assert fmean(row["views"]["photo_0"]["wood_f"] for row in truth_scores.values()) >= 0.6


@pytest.mark.slow
@pytest.mark.gl
def test_unseen_sides_are_no_worse_than_the_turned_outline(truth_scores: dict[str, dict[str, Any]]) -> None:
    above = [row["unseen_envelope_iou"] - row["unseen_revolve_iou"] for row in truth_scores.values()]
    assert fmean(above) >= -0.02
