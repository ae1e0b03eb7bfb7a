"""tinyusdz reads every layer of every profile as written, and draws the packages; it composes nothing (0.9.4)."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Sdf, Usd, UsdGeom

from forestgen.usd.profiles import FLAT, PROFILES
from tests.readers.conftest import Made
from tests.readers.strangers import ask, assert_agree, written

TEXT = 2e-6  # instancers' arrays are to be had as text only, with 6 or 7 digits


def layers(made: Made, profile: str) -> list[Path]:
    folder = made["oak", profile].parent
    return sorted(path for path in folder.rglob("*.usd?") if path.is_file())


@pytest.mark.parametrize("profile", PROFILES)
def test_it_reads_each_layer_as_written(made: Made, profile: str) -> None:
    found = set()
    for path in layers(made, profile):
        layer = Sdf.Layer.FindOrOpen(str(path))
        answer = ask("lightusd", "tinyusdz_reads.py", path)
        assert (answer["up"], answer["metres"], answer["default"]) == ("Y", 1.0, layer.defaultPrim)
        ours = written(layer)
        assert_agree(answer["prims"], ours, rtol=TEXT)
        found.update(ours)
    assert len(found) >= 2


@pytest.mark.parametrize("profile", FLAT)
@pytest.mark.parametrize("subject", ["oak", "bare", "wood"])
def test_it_draws_the_packages(made: Made, subject: str, profile: str) -> None:
    path = made[subject, profile]
    drawn = ask("lightusd", "tinyusdz_reads.py", path)["drawn"]
    stage = Usd.Stage.Open(str(path))
    meshes = {str(prim.GetPath()): UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)}
    assert set(drawn["meshes"]) == set(meshes)
    n_materials = {"oak": 2, "bare": 1, "wood": 4}[subject]  # the ground's is plain
    assert (drawn["materials"], drawn["images"]) == (n_materials, {"oak": 2, "bare": 1, "wood": 3}[subject])


def test_it_composes_nothing(made: Made) -> None:
    """What is known not to work: neither payloads nor references nor variants are followed."""
    for subject, profile in (("oak", "usd"), ("oak", "blender"), ("oak", "unreal"), ("wood", "usd")):
        answer = ask("lightusd", "tinyusdz_reads.py", made[subject, profile])
        assert not any("LOD" in path or "leaves" in path for path in answer["prims"])
    alone = ask("lightusd", "tinyusdz_reads.py", made["oak", "usd"].with_name("geometry.usdc"))
    assert "Cannot find path </oak/mtl/bark>" in alone["drawn"]  # a binding into another layer stops its drawing
