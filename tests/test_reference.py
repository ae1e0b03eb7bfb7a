"""What a tree keeps for its check survives a round trip through files."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.errors import InputError
from forestgen.reference import (
    read_provenance,
    read_reference,
    read_views,
    write_provenance,
    write_reference,
)
from forestgen.tree.mattes import Mattes
from tests.check.trees import tree_model

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return tree_model(tmp_path_factory.mktemp("asset"), name="Ahorn <1> \N{DECIDUOUS TREE}")


def test_a_view_comes_back_as_it_was(model, tmp_path):
    view = model.views[0]
    turned = replace(view, camera=replace(view.camera, azimuth=0.5, elevation=-0.1, focal_px=800.0))
    write_reference(turned, tmp_path / "reference" / "view_00")
    back = read_reference(tmp_path / "reference" / "view_00")
    assert_array_equal(back.photo.rgb, view.photo.rgb)  # PNG: to the bit
    assert back.photo.name == "small tree.jpg"
    assert_array_equal(back.mattes.is_foliage, view.mattes.is_foliage)
    assert_array_equal(back.mattes.is_branch, view.mattes.is_branch)
    assert_allclose(back.branches.xy, view.branches.xy)
    assert_array_equal(back.branches.parent, view.branches.parent)
    assert_array_equal(back.branches.radius_px, view.branches.radius_px)  # NaN stays NaN
    assert_array_equal(back.strokes.crown, view.strokes.crown)
    assert_array_equal(back.strokes.background[0], view.strokes.background[0])
    assert back.strokes.density[0].radius_px == 6
    points = np.random.default_rng(0).normal(size=(20, 3))
    assert_allclose(back.camera.project(points), turned.camera.project(points), atol=1e-9)


def test_mattes_keep_to_their_side_of_one_half(model, tmp_path):
    view = model.views[0]
    alpha = np.random.default_rng(2).uniform(0.49, 0.51, view.mattes.foliage.shape).astype(np.float32)
    alpha[0, :3] = [0.5, np.nextafter(np.float32(0.5), np.float32(0)), 1.0]
    write_reference(replace(view, mattes=Mattes(alpha, 1 - alpha)), tmp_path)
    back = read_reference(tmp_path).mattes
    assert_array_equal(back.is_foliage, alpha >= 0.5)
    assert_array_equal(back.is_branch, 1 - alpha >= 0.5)


def test_provenance_comes_back_as_it_was(model, tmp_path):
    write_provenance(model, tmp_path)
    back = read_provenance(tmp_path)
    assert (back.name, back.method, back.seed, back.height) == (model.name, "tan2008", 3, model.height)
    assert_array_equal(back.skeleton.position, model.skeleton.position)
    assert_array_equal(back.skeleton.parent, model.skeleton.parent)
    assert_array_equal(back.costs["image_cost"], model.costs["image_cost"])
    assert back.notes == model.notes


def test_files_name_no_path_and_are_the_same_each_time(model, tmp_path):
    for k in range(2):
        write_provenance(model, tmp_path / str(k))
        write_reference(model.views[0], tmp_path / str(k) / "view_00")
    files = sorted(path.relative_to(tmp_path / "0") for path in (tmp_path / "0").rglob("*") if path.is_file())
    assert len(files) == 8
    for file in files:
        content = (tmp_path / "0" / file).read_bytes()
        assert content == (tmp_path / "1" / file).read_bytes()
        assert str(tmp_path).encode() not in content


@pytest.mark.parametrize("file", ["photo.png", "branch.png", "trace.json", "view.json"])
@pytest.mark.parametrize("damage", ["gone", "empty", "cut"])
def test_a_damaged_reference_is_named(model, tmp_path, file, damage):
    write_reference(model.views[0], tmp_path)
    content = (tmp_path / file).read_bytes()
    (tmp_path / file).unlink()
    if damage != "gone":
        (tmp_path / file).write_bytes(content[: 0 if damage == "empty" else 40])
    with pytest.raises(InputError, match=file):
        read_reference(tmp_path)


def test_a_reference_that_contradicts_itself_is_refused(model, tmp_path):
    write_reference(model.views[0], tmp_path)
    camera = json.loads((tmp_path / "view.json").read_text())
    (tmp_path / "view.json").write_text(json.dumps({**camera, "size": [3, 4]}))
    with pytest.raises(InputError, match="build the tree again"):
        read_reference(tmp_path)


def test_damaged_provenance_is_named(model, tmp_path):
    write_provenance(model, tmp_path)
    (tmp_path / "skeleton.npz").write_bytes(b"PK\x03\x04 no archive")
    with pytest.raises(InputError, match="build the tree again"):
        read_provenance(tmp_path)
    with pytest.raises(InputError, match="holds no view"):
        read_views(tmp_path)
