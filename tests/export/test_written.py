"""What a build wrote, read back and exported: the same tree."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from forestgen.errors import InputError
from forestgen.export.gltf import INSTANCING, write_glb
from tests.export.glb_reader import Glb
from tests.export.subjects import CARD_RGBA, levels_of, oak, read_subject


def test_a_written_tree_becomes_what_its_model_becomes(written: Path, tmp_path: Path) -> None:
    """All but what USD rounds: halves for turns, a colour's mean from texels."""
    tree = read_subject(written)
    found = Glb(write_glb(tree.model, tree.levels, tmp_path / "a.glb", card_rgba=tree.card_rgba))
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


@pytest.mark.parametrize("texture", ["leaf", "bark", "leaf_cards"])
def test_a_texture_that_is_missing(written: Path, tmp_path: Path, texture: str) -> None:
    """An input error that names it."""
    folder = tmp_path / "trees" / "oak"
    shutil.copytree(written, folder)
    (folder / "textures" / f"{texture}.png").unlink()
    with pytest.raises(InputError, match=rf"{texture}\.png"):
        read_subject(folder)
