"""No validator finds anything in what we write, and ours tells when something is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Usd, UsdGeom

from forestgen.errors import InputError
from forestgen.usd.validate import validate


@pytest.mark.parametrize("which", ["oak", "bare", "scene", "cameras"])
def test_usd_finds_nothing(which: str, oak: Path, bare: Path, scene: Path) -> None:
    path = {"oak": oak, "bare": bare, "scene": scene, "cameras": oak.with_name("cameras.usda")}[which]
    assert validate(path) == []


@pytest.mark.parametrize("which", ["oak", "bare", "scene", "cameras"])
def test_nvidias_validator_finds_nothing(which: str, oak: Path, bare: Path, scene: Path) -> None:
    nvidia = pytest.importorskip("usd_validation_nvidia")
    path = {"oak": oak, "bare": bare, "scene": scene, "cameras": oak.with_name("cameras.usda")}[which]
    assert list(nvidia.ValidationEngine().validate(str(path)).issues()) == []


def test_findings_say_what_and_where(tmp_path: Path) -> None:
    path = tmp_path / "bad.usda"
    stage = Usd.Stage.CreateNew(str(path))  # no up axis, no unit, no default prim
    UsdGeom.Mesh.Define(stage, "/outer")
    UsdGeom.Mesh.Define(stage, "/outer/inner")
    stage.GetPrimAtPath("/outer").GetReferences().AddReference("./missing.usda")
    stage.Save()
    del stage
    findings = validate(path)
    assert any("/outer/inner" in f.place for f in findings)
    assert any("missing.usda" in f.message for f in findings)
    assert all(f.validator and f.error and f.message for f in findings)


def test_what_is_no_usd_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        validate(tmp_path / "none.usda")
    (tmp_path / "text.usda").write_text("not a stage")
    with pytest.raises(InputError, match="cannot be opened as USD"):
        validate(tmp_path / "text.usda")
