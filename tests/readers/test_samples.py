"""Readers before trees that were built from photos: those below the folder that FORESTGEN_OUT names.

`make readers` builds one and names it; a tree takes a minute.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from pxr import Usd

from forestgen.usd.profiles import FLAT, PROFILES, write_profile
from forestgen.usd.read import read_drawables
from forestgen.usd.validate import validate
from tests.readers.strangers import ask, assert_agree, camera_of, composed, iou, our_mask, their_mask

OUT = os.environ.get("FORESTGEN_OUT")
TREES = sorted(path.parent for path in Path(OUT).glob("**/trees/*/cameras.usda")) if OUT else []
EXPECTED_IOU = 0.97
INSTANCED = ("usd", "blender")  # the others have leaves flattened

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not TREES, reason="no FORESTGEN_OUT with trees that were built: make readers"),
]


@pytest.mark.gl
@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("tree", TREES, ids=lambda tree: tree.name)
def test_a_tree_from_a_photo(tree: Path, profile: str, tmp_path: Path) -> None:
    nvidia = pytest.importorskip("usd_validation_nvidia")
    path = write_profile(tree, tmp_path / "made", profile, level=0 if profile in FLAT else None)
    assert validate(path) == []
    assert [str(issue) for issue in nvidia.ValidationEngine().validate(str(path)).issues()] == []
    drawables = read_drawables(path)

    stage = Usd.Stage.Open(str(path))
    assert_agree(ask("lightusd", "lightusd_reads.py", path)["prims"], composed(stage))

    camera, mask = camera_of(tree / "cameras.usda"), tmp_path / "mask.png"
    asked = ("--cameras", tree / "cameras.usda", "--mask", mask, "--size", *camera.size)
    answer = ask("bpy", "blender_reads.py", path, *asked)
    assert answer["triangles"] == sum(drawable.n_triangles for drawable in drawables)
    assert answer["instances"] == sum(len(d.transforms) for d in drawables if d.is_leaf and profile in INSTANCED)
    assert iou(their_mask(mask), our_mask(drawables, camera)) >= EXPECTED_IOU
