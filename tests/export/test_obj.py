"""A tree as OBJ, read back by trimesh and by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from forestgen.errors import InputError
from forestgen.export.obj import write_obj
from forestgen.tree.level import full_level
from forestgen.tree.model import Bark, Mesh
from forestgen.usd.flatten import flat_leaves
from tests.export.subjects import CARD_RGBA, levels_of, oak, without_atlas
from tests.usd.models import tree_model


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_obj(oak(), full_level(oak()), tmp_path_factory.mktemp("obj") / "oak.obj")


def corners(mesh: Mesh) -> NDArray[np.float64]:
    """What each corner of each triangle is (F, 3, 8): place, texture coordinate, normal."""
    return np.concatenate([mesh.points, mesh.uv, mesh.normals], axis=1)[mesh.faces]


def read(path: Path) -> dict[str, NDArray[np.float64]]:
    """Corners (F, 3, 8) by group, from the text alone."""
    kept: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    groups: dict[str, list[list[list[float]]]] = {}
    for line in path.read_text().splitlines():
        word, *rest = line.split()
        if word in kept:
            kept[word].append([float(number) for number in rest])
        elif word == "g":
            group = groups.setdefault(rest[0], [])
        elif word == "f":
            of = [[int(index) - 1 for index in corner.split("/")] for corner in rest]
            group.append([kept["v"][a] + kept["vt"][b] + kept["vn"][c] for a, b, c in of])
    return {name: np.array(faces) for name, faces in groups.items()}


def test_every_corner_is_the_models(path: Path) -> None:
    model, found = oak(), read(path)
    assert list(found) == ["branches", "leaves"]
    assert_allclose(found["branches"], corners(model.mesh), atol=6e-5)
    assert_allclose(found["leaves"], corners(flat_leaves(model.leaves, model.atlas.prototypes)[0]), atol=6e-5)


def test_leaves_share_their_texture_coordinates(path: Path) -> None:
    lines = path.read_text().splitlines()
    assert sum(line.startswith("vt ") for line in lines) == 8 + 3 * 3


def test_pictures_and_cut_out(path: Path) -> None:
    model = oak()
    text = path.with_suffix(".mtl").read_text()
    assert "newmtl bark" in text
    assert "map_Kd oak_leaf.png\nmap_d oak_leaf_mask.png" in text
    leaf = cv2.imread(str(path.with_name("oak_leaf.png")), cv2.IMREAD_UNCHANGED)
    mask = cv2.imread(str(path.with_name("oak_leaf_mask.png")), cv2.IMREAD_UNCHANGED)
    assert_array_equal(leaf[..., [2, 1, 0, 3]], model.atlas.rgba)
    assert_array_equal(mask, np.repeat(model.atlas.rgba[..., 3:], 4, axis=2))


def test_trimesh_reads_it(path: Path) -> None:
    model = oak()
    scene = trimesh.load_scene(path)
    flat, _ = flat_leaves(model.leaves, model.atlas.prototypes)
    every = np.concatenate([model.mesh.points, flat.points])
    assert_allclose(scene.bounds, [every.min(axis=0), every.max(axis=0)], atol=1e-5)
    areas = sorted(mesh.area for mesh in scene.geometry.values())
    assert_allclose(areas, sorted(trimesh.Trimesh(m.points, m.faces).area for m in (model.mesh, flat)), rtol=1e-4)
    assert_array_equal(scene.geometry["bark"].visual.material.image, model.bark.rgb)
    assert_array_equal(scene.geometry["leaf"].visual.material.image, model.atlas.rgba)


def test_cards_and_plain_bark(tmp_path: Path) -> None:
    model = replace(oak(), bark=Bark(np.array([[[188, 0, 255]]], np.uint8), 1.0, 1.0))
    level = replace(levels_of(model)[2], mesh=model.mesh)
    write_obj(model, level, tmp_path / "oak.obj", card_rgba=CARD_RGBA)
    text = (tmp_path / "oak.mtl").read_text()
    assert "newmtl bark\nKd 0.5029 0.0000 1.0000\n" in text
    assert "map_Kd oak_leaf_cards.png" in text
    assert list(read(tmp_path / "oak.obj")) == ["branches", "leaf_cards"]
    assert not (tmp_path / "oak_bark.png").exists()


def test_names_beside_it_have_no_blanks(tmp_path: Path) -> None:
    write_obj(tree_model(n_leaves=0), full_level(tree_model(n_leaves=0)), tmp_path / "Alte Eiche (1).obj")
    assert {entry.name for entry in tmp_path.iterdir()} == {
        "Alte Eiche (1).obj",
        "Alte_Eiche_1.mtl",
        "Alte_Eiche_1_bark.png",
    }
    assert "mtllib Alte_Eiche_1.mtl\n" in (tmp_path / "Alte Eiche (1).obj").read_text()


def test_same_tree_same_bytes(path: Path, tmp_path: Path) -> None:
    write_obj(oak(), full_level(oak()), tmp_path / "oak.obj")
    for entry in sorted(path.parent.iterdir()):
        assert entry.read_bytes() == (tmp_path / entry.name).read_bytes()


def test_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no leaf atlas"):
        write_obj(without_atlas(oak()), full_level(oak()), tmp_path / "oak.obj")
    with pytest.raises(InputError, match="no card atlas"):
        write_obj(oak(), levels_of(oak())[2], tmp_path / "oak.obj")
    with pytest.raises(InputError, match=r"ends in \.obj"):
        write_obj(oak(), full_level(oak()), tmp_path / "oak.glb")
    assert list(tmp_path.iterdir()) == []
