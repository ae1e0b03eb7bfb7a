"""What a build wrote, exported: the same tree, whatever the kind of file."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from forestgen.errors import InputError
from forestgen.export.gltf import INSTANCING, LOD, write_glb
from forestgen.export.written import export_tree
from tests.export.glb_reader import Glb
from tests.export.subjects import CARD_RGBA, levels_of, oak


def test_a_written_tree_becomes_what_its_model_becomes(written: Path, tmp_path: Path) -> None:
    """All but what USD rounds: halves for turns, a colour's mean from texels."""
    found = Glb(export_tree(written, tmp_path / "a.glb"))
    ours = Glb(write_glb(oak(), levels_of(oak()), tmp_path / "b.glb", card_rgba=CARD_RGBA))
    for name in ("branches", "branches_LOD1", "leaf_01", "leaf_02_LOD1", "leaf_cards_LOD2"):
        left, right = found.primitive(found.node(name)["mesh"]), ours.primitive(ours.node(name)["mesh"])
        for what, values in right.items():
            assert_allclose(left[what], values, atol=1e-6, err_msg=f"{name} {what}")
    left, right = (glb.node("leaf_01")["extensions"][INSTANCING]["attributes"] for glb in (found, ours))
    for what in ("TRANSLATION", "SCALE"):
        assert_allclose(found.array(left[what]), ours.array(right[what]), atol=1e-6)
    assert_allclose(found.array(left["ROTATION"]), ours.array(right["ROTATION"]), atol=1e-3)
    roots = [glb.node("oak") for glb in (found, ours)]
    assert_allclose(*(root["extras"]["MSFT_screencoverage"] for root in roots))
    assert roots[0]["extras"]["forestgen"] == roots[1]["extras"]["forestgen"]


def test_one_level_alone(written: Path, tmp_path: Path) -> None:
    glb = Glb(export_tree(written, tmp_path / "oak.glb", level=2))
    assert [node["name"] for node in glb.json["nodes"]] == ["leaf_cards", "oak"]
    assert LOD not in glb.json.get("extensionsUsed", [])
    export_tree(written, tmp_path / "oak.obj", level=1)
    n_faces = sum(line.startswith("f ") for line in (tmp_path / "oak.obj").read_text().splitlines())
    assert n_faces == levels_of(oak())[1].n_triangles


def test_refused(written: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"levels of detail 0 to 2, not 3"):
        export_tree(written, tmp_path / "oak.glb", level=3)
    with pytest.raises(InputError, match=r"oak.fbx: expected a name that ends in \.glb or \.obj"):
        export_tree(written, tmp_path / "oak.fbx")
    with pytest.raises(InputError, match="expected the folder of a built tree"):
        export_tree(tmp_path, tmp_path / "oak.glb")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("texture", ["leaf", "bark", "leaf_cards"])
@pytest.mark.parametrize("name", ["oak.glb", "oak.obj"])
def test_a_texture_that_is_missing(written: Path, tmp_path: Path, texture: str, name: str) -> None:
    """An input error that names it, and no file."""
    folder = tmp_path / "trees" / "oak"
    shutil.copytree(written, folder)
    (folder / "textures" / f"{texture}.png").unlink()
    with pytest.raises(InputError, match=rf"{texture}\.png"):
        export_tree(folder, tmp_path / "out" / name)
    assert not (tmp_path / "out").exists()
