"""Packages: an archive as the usdz specification wants it, and what an asset needs, whole or refused."""

from __future__ import annotations

import os
import struct
import time
import zipfile
from pathlib import Path

import pytest
from pxr import Usd

from forestgen.errors import InputError
from forestgen.usd.package import ALIGNMENT, dependencies, write_usdz


def data_offset(path: Path, entry: zipfile.ZipInfo) -> int:
    """Where a stored file's bytes begin: read from the archive itself."""
    header = path.read_bytes()[entry.header_offset : entry.header_offset + 30]
    name, extra = struct.unpack("<HH", header[26:30])
    return entry.header_offset + 30 + name + extra


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    """Sizes around the alignment: paddings of every length, also those too short for a padding's own header."""
    found = {}
    for size in range(140):
        name = "a" * (1 + size % 7) + f"{size}.png"
        (tmp_path / name).write_bytes(bytes([size % 251]) * size)
        found[f"textures/{name}"] = tmp_path / name
    return found


def test_every_file_is_stored_plain_and_aligned(tmp_path: Path, files: dict[str, Path]) -> None:
    path = write_usdz(tmp_path / "a.usdz", files)
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        assert archive.namelist() == list(files)
        for entry in archive.infolist():
            assert entry.compress_type == zipfile.ZIP_STORED
            start = data_offset(path, entry)
            assert start % ALIGNMENT == 0
            data = files[entry.filename].read_bytes()
            assert path.read_bytes()[start : start + len(data)] == data


def test_bytes_depend_on_names_and_contents_alone(tmp_path: Path, files: dict[str, Path]) -> None:
    first = write_usdz(tmp_path / "a.usdz", files).read_bytes()
    for file in files.values():
        os.utime(file, (time.time() - 10_000_000,) * 2)
        file.chmod(0o600)
    assert write_usdz(tmp_path / "b.usdz", files).read_bytes() == first


def test_usd_opens_it_and_resolves_inside(tmp_path: Path, oak: Path) -> None:
    stage = Usd.Stage.Open(str(oak)).Flatten(False)
    stage.GetAttributeAtPath("/oak/mtl/leaf/texture.inputs:file").default = "./textures/leaf.png"
    stage.Export(str(tmp_path / "oak.usdc"))
    path = write_usdz(
        tmp_path / "oak.usdz",
        {"oak.usdc": tmp_path / "oak.usdc", "textures/leaf.png": oak.parent / "textures" / "leaf.png"},
    )
    packed = Usd.Stage.Open(str(path))
    assert packed.GetDefaultPrim().GetName() == "oak"
    file = packed.GetPrimAtPath("/oak/mtl/leaf/texture").GetAttribute("inputs:file").Get()
    assert file.resolvedPath == f"{path}[textures/leaf.png]"


def test_dependencies_are_the_whole_asset(oak: Path, scene: Path) -> None:
    found = dependencies(oak, oak.parent)
    assert found[0] == Path("oak.usda")
    here = {file.relative_to(oak.parent) for file in oak.parent.rglob("*") if file.is_file()}
    assert set(found) == here - {Path("cameras.usda")}
    of_scene = dependencies(scene, scene.parent)
    assert of_scene[0] == Path("wood.usda")
    assert {Path("trees/oak/oak.usda"), Path("trees/oak/cameras.usda"), Path("trees/bare/bare.usda")} < set(of_scene)


def test_what_is_missing_or_outside_is_told(tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    root = tmp_path / "inner" / "a.usda"
    root.write_text('#usda 1.0\ndef "a" (references = @./gone.usda@</a>)\n{\n}\n')
    with pytest.raises(InputError, match=r"a\.usda: needs .*gone\.usda, which is not there"):
        dependencies(root, root.parent)
    (tmp_path / "other.usda").write_text('#usda 1.0\ndef "a"\n{\n}\n')
    root.write_text('#usda 1.0\ndef "a" (references = @../other.usda@</a>)\n{\n}\n')
    with pytest.raises(InputError, match=r"other\.usda, which lies outside"):
        dependencies(root, root.parent)
