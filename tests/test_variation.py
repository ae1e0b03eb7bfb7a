"""Variations of a built tree: other seeds, the same photos, whole assets, and nothing else touched."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen import variation
from forestgen.build_record import BUILD, write_record
from forestgen.errors import InputError, RenderError, StageError
from forestgen.pipeline import build_model, write_tree
from forestgen.reference import read_provenance, read_views
from forestgen.scene.manifest import load_scene
from forestgen.staging import PREFIX
from forestgen.tree.methods import METHODS
from forestgen.tree.strokes import DensityStroke
from forestgen.usd.validate import validate
from forestgen.variation import contact_sheet, recorded_method, regrown, vary_tree
from tests.small_scene import digests, write_scene

FEW_LEAVES = "[tree.settings.leaves]\nlayers = 0.5\nfill_rounds = 1\n"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A build of one small tree, without its report."""
    folder = tmp_path_factory.mktemp("scene")
    scene = load_scene(write_scene(folder, "Linde 1", extra=FEW_LEAVES))
    (tree,) = scene.trees
    out = folder / "out"
    write_tree(build_model(tree), tree.prim_name, out / "trees")
    write_record(out, scene, {})
    return out


@pytest.fixture
def tree(built: Path, tmp_path: Path) -> Path:
    """A tree's folder of one's own, in its build."""
    shutil.copytree(built, tmp_path / "out")
    return next((tmp_path / "out" / "trees").iterdir())


@pytest.fixture
def no_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Portraits are drawn in no time."""
    monkeypatch.setattr(variation, "_draw_job", lambda job, on_stage: np.zeros((8, 6, 3), np.uint8))


def test_variations_are_whole_assets_beside_the_tree_and_a_sheet(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(variation, "PORTRAIT", (90, 110))
    before = digests(tree)
    seen: list[tuple[int, str]] = []
    made = vary_tree(tree, 2, on_progress=lambda index, stage, done, total: seen.append((index, stage)))
    assert made["passed"]
    assert {stage for _, stage in seen} <= {"", *variation.STEPS}
    shapes = [read_provenance(tree / "reference").skeleton.position]
    for one, seed in zip(made["variations"], (made["seed"] + 1, made["seed"] + 2), strict=True):
        asset = tree / one["asset"]
        assert one["seed"] == seed
        assert validate(asset) == []
        kept = read_provenance(asset.parent / "reference")
        assert kept.seed == seed
        shapes.append(kept.skeleton.position)
    assert len({shape.tobytes() for shape in shapes}) == 3
    sheet = cv2.imread(str(tree / made["sheet"]))
    assert sheet.shape[:2] == (2 * (variation.PORTRAIT[1] + variation.CAPTION), 4 * variation.PORTRAIT[0])
    after = digests(tree)
    assert {name: after[name] for name in before} == before
    assert not list(tree.glob(PREFIX + "*"))
    assert len(read_views(tree / "reference")) == 1


@pytest.mark.usefixtures("no_drawing")
def test_the_same_seeds_give_the_same_bytes_and_replace_the_earlier_ones(tree: Path) -> None:
    vary_tree(tree, 2)
    before = digests(tree / "variations")
    vary_tree(tree, 1)
    after = digests(tree / "variations")
    assert 0 < len(after) < len(before)
    assert {name: before[name] for name in after if name.endswith((".usda", ".usdc", ".npz"))} == {
        name: digest for name, digest in after.items() if name.endswith((".usda", ".usdc", ".npz"))
    }


def test_the_built_seed_grown_again_is_the_built_tree(tree: Path) -> None:
    provenance, views = read_provenance(tree / "reference"), read_views(tree / "reference")
    again = regrown(views, recorded_method(tree, provenance, Path()), provenance, provenance.seed)
    assert again.views[0].mattes is views[0].mattes
    # mattes come back in 256 steps, so a twig may differ; the visible branches and the crown do not
    old, new = provenance.skeleton.position, again.skeleton.position
    assert_allclose(np.ptp(new, axis=0), np.ptp(old, axis=0), rtol=0.05)
    assert_allclose(new[:5], old[:5], atol=1e-6)


def test_views_stay_as_they_were_found_also_where_foliage_was_painted(tree: Path) -> None:
    provenance, (view,) = read_provenance(tree / "reference"), read_views(tree / "reference")
    stroke = DensityStroke(True, 12.0, view.strokes.crown.mean(axis=0)[None])
    painted = replace(view, strokes=replace(view.strokes, density=(stroke,)))
    (again,) = regrown([painted], recorded_method(tree, provenance, Path()), provenance, 5).views
    assert again is painted  # neither painted once more, nor its camera found anew


def test_settings_come_from_the_build_record_or_else_from_the_method(tree: Path) -> None:
    provenance = read_provenance(tree / "reference")
    assert recorded_method(tree, provenance, Path()).grow.iterations == 3  # as the manifest says
    (tree.parents[1] / BUILD).unlink()
    assert recorded_method(tree, provenance, Path()) == METHODS["tan2008"]


@pytest.mark.usefixtures("no_drawing")
def test_a_seed_that_defeats_a_stage_is_told_and_the_others_are_written(
    tree: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    grow = variation._grow_job

    def fails_once(job, on_stage):
        if job.seed % 2:
            raise StageError("nothing grew")
        return grow(job, on_stage)

    monkeypatch.setattr(variation, "_grow_job", fails_once)
    made = vary_tree(tree, 2)
    assert not made["passed"]
    told = [one.get("error") for one in made["variations"]]
    assert sorted(map(str, told)) == ["None", "nothing grew"]
    assert len(list((tree / "variations").glob("*/*.usda"))) == 1


def test_without_a_renderer_the_assets_are_there(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(job, on_stage):
        raise RenderError("no OpenGL")

    monkeypatch.setattr(variation, "_draw_job", fails)
    with pytest.raises(RenderError):
        vary_tree(tree, 1)
    assert len(list((tree / "variations").glob("*/*.usda"))) == 1
    assert not list(tree.glob(PREFIX + "*"))


def test_what_is_no_built_tree_is_refused(tree: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a tree's folder"):
        vary_tree(tmp_path, 1)
    record = tree.parents[1] / BUILD
    content = json.loads(record.read_text())
    content["tree"][0]["settings"]["grow"]["unheard"] = 1
    record.write_text(json.dumps(content))
    with pytest.raises(InputError, match="build the scene again"):
        vary_tree(tree, 1)
    record.write_text("{")
    with pytest.raises(InputError, match="cannot be read"):
        vary_tree(tree, 1)
    assert not (tree / "variations").exists()


def test_a_sheet_has_room_for_all() -> None:
    portraits = [np.full((10, 8, 3), k, np.uint8) for k in range(5)]
    sheet = contact_sheet(portraits, [str(k) for k in range(5)])
    assert sheet.shape == (2 * (10 + variation.CAPTION), 24, 3)
    assert sheet[0, 0, 0] == 0
    assert sheet[10 + variation.CAPTION, 8, 0] == 4
