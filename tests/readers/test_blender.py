"""Blender imports each profile: as many objects and instances as were written, and the picture that we draw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.usd.profiles import PROFILES, write_profile
from forestgen.usd.read import read_drawables
from tests.readers.conftest import Made
from tests.readers.strangers import ask, iou, our_mask, their_mask
from tests.usd.subjects import CAMERA

EXPECTED_IOU = 0.97
INSTANCED = {"usd": 600, "blender": 600, "web": 0, "arkit": 0, "unreal": 0}  # leaves of the oak
SIZE = ("--size", *CAMERA.size)


@pytest.mark.gl
@pytest.mark.parametrize("profile", PROFILES)
def test_the_oak_as_we_draw_it(made: Made, out: Path, tmp_path: Path, profile: str) -> None:
    path, cameras = made["oak", profile], out / "trees" / "oak" / "cameras.usda"
    answer = ask("bpy", "blender_reads.py", path, "--cameras", cameras, "--mask", tmp_path / "mask.png", *SIZE)
    drawables = read_drawables(path)
    assert answer["instances"] == INSTANCED[profile]
    assert answer["triangles"] == sum(drawable.n_triangles for drawable in drawables)
    assert answer["missing"] == []
    assert answer["materials"] == ["bark", "leaf"]
    assert answer["images"] == ["bark.png", "leaf.png"]
    assert "CURVES" not in answer["objects"]
    corners = np.concatenate([(d.points @ place[:3, :3].T + place[:3, 3]) for d in drawables for place in d.transforms])
    assert_allclose(answer["bounds"], [corners.min(axis=0), corners.max(axis=0)], atol=1e-5)
    assert iou(their_mask(tmp_path / "mask.png"), our_mask(drawables, CAMERA)) >= EXPECTED_IOU


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("subject", ["bare", "wood", "points"])
def test_everything_arrives(made: Made, subject: str, profile: str) -> None:
    path = made[subject, profile]
    answer = ask("bpy", "blender_reads.py", path)
    drawables = read_drawables(path)
    assert answer["triangles"] == sum(drawable.n_triangles for drawable in drawables)
    corners = np.concatenate([(d.points @ place[:3, :3].T + place[:3, 3]) for d in drawables for place in d.transforms])
    assert_allclose(answer["bounds"], [corners.min(axis=0), corners.max(axis=0)], atol=1e-5)
    assert answer["missing"] == []


@pytest.mark.gl
@pytest.mark.parametrize("level", [1, 2])
def test_coarser_levels(out: Path, tmp_path: Path, level: int) -> None:
    path = write_profile(out / "trees" / "oak", tmp_path / "made", "blender", level=level)
    cameras, mask = path.with_name("cameras.usda"), tmp_path / "mask.png"
    answer = ask("bpy", "blender_reads.py", path, "--cameras", cameras, "--mask", mask, *SIZE)
    assert answer["instances"] == (200, 0)[level - 1]
    assert iou(their_mask(mask), our_mask(read_drawables(path), CAMERA)) >= EXPECTED_IOU
