"""A tree as glTF binary, read back by a reader of our own: every number is the model's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from forestgen.errors import InputError
from forestgen.export import gltf
from forestgen.export.gltf import INSTANCING, LOD, write_glb, write_scene_glb
from forestgen.export.subject import Subject
from forestgen.scene.forest import Forest
from forestgen.tree.level import EMPTY_MESH, Level, full_level
from forestgen.tree.model import Bark, Mesh
from forestgen.usd.flatten import flat_leaves
from tests.export.glb_reader import Glb
from tests.export.subjects import CARD_RGBA, broken, levels_of, oak, without_atlas
from tests.usd.models import tree_model


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tree of three levels."""
    folder = tmp_path_factory.mktemp("wald ü 树")
    return write_glb(oak(), levels_of(oak()), folder / "oak 1.glb", card_rgba=CARD_RGBA)


@pytest.fixture(scope="module")
def glb(path: Path) -> Glb:
    return Glb(path)


def test_wood_is_the_models(glb: Glb) -> None:
    mesh, found = oak().mesh, glb.primitive(glb.node("branches")["mesh"])
    assert_array_equal(found["POSITION"], mesh.points.astype(np.float32))
    assert_array_equal(found["NORMAL"], mesh.normals.astype(np.float32))
    assert_allclose(found["TEXCOORD_0"], np.column_stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]]), atol=1e-6)
    assert_array_equal(found["faces"], mesh.faces)


def test_each_leaf_stands_where_the_model_has_it(glb: Glb) -> None:
    model = oak()
    n_found = 0
    for k, prototype in enumerate(model.atlas.prototypes):
        node = glb.node(f"leaf_{k:02d}")
        assert_array_equal(glb.primitive(node["mesh"])["POSITION"], prototype.points.astype(np.float32))
        places = {name: glb.array(at) for name, at in node["extensions"][INSTANCING]["attributes"].items()}
        chosen = model.leaves.prototype == k
        assert_array_equal(places["TRANSLATION"], model.leaves.position[chosen].astype(np.float32))
        assert_array_equal(places["SCALE"], np.tile(model.leaves.size[chosen, None].astype(np.float32), 3))
        turn, ours = places["ROTATION"], model.leaves.orientation[chosen][:, [1, 2, 3, 0]]
        assert_allclose(turn, ours, atol=2e-5)
        n_found += len(turn)
    assert n_found == len(model.leaves)


def test_turns_are_shorts_as_the_extension_allows_and_nearly_unit(glb: Glb) -> None:
    attributes = glb.node("leaf_00")["extensions"][INSTANCING]["attributes"]
    entry = glb.json["accessors"][attributes["ROTATION"]]
    assert (entry["componentType"], entry["normalized"], entry["type"]) == (5122, True, "VEC4")
    assert_allclose(np.linalg.norm(glb.array(attributes["ROTATION"]), axis=1), 1, atol=5e-5)


def test_flattened_leaves_are_one_mesh_in_the_same_places(tmp_path: Path) -> None:
    model = oak()
    glb = Glb(write_glb(model, [full_level(model)], tmp_path / "oak.glb", instancing=False))
    flat, found = flat_leaves(model.leaves, model.atlas.prototypes)[0], glb.primitive(glb.node("leaves")["mesh"])
    assert_array_equal(found["POSITION"], flat.points.astype(np.float32))
    assert_array_equal(found["faces"], flat.faces)
    assert "extensionsUsed" not in glb.json


def test_the_finest_level_is_in_the_scene_and_names_the_others(glb: Glb) -> None:
    nodes = glb.json["nodes"]
    (root,) = glb.json["scenes"][glb.json["scene"]]["nodes"]
    ids = nodes[root]["extensions"][LOD]["ids"]
    assert [nodes[k]["name"] for k in (root, *ids)] == ["oak", "oak_LOD1", "oak_LOD2"]
    assert nodes[root]["extras"]["MSFT_screencoverage"] == [0.25, 0.05, 0.0]
    assert [nodes[k]["name"] for k in nodes[ids[0]]["children"]][:2] == ["branches_LOD1", "leaf_00_LOD1"]
    assert [nodes[k]["name"] for k in nodes[ids[1]]["children"]] == ["leaf_cards_LOD2"]
    everyone = [child for node in nodes for child in node.get("children", [])]
    assert len(set(everyone)) == len(everyone), "a node with two parents"


def test_levels_share_what_they_have_in_common(glb: Glb) -> None:
    assert glb.node("leaf_01")["mesh"] == glb.node("leaf_01_LOD1")["mesh"]
    assert glb.node("branches")["mesh"] != glb.node("branches_LOD1")["mesh"]
    assert len(glb.json["images"]) == len(glb.json["materials"]) == 3


def test_surfaces(glb: Glb) -> None:
    bark = glb.material_of(glb.node("branches"))
    assert bark.get("alphaMode", "OPAQUE") == "OPAQUE"
    assert_array_equal(glb.image(bark["index"]), oak().bark.rgb)
    for name, picture in (("leaf_00", oak().atlas.rgba), ("leaf_cards_LOD2", CARD_RGBA)):
        material = glb.material_of(glb.node(name))
        assert (material["alphaMode"], material["alphaCutoff"], material["doubleSided"]) == ("MASK", 0.5, True)
        assert material["pbrMetallicRoughness"]["metallicFactor"] == 0
        assert_array_equal(glb.image(material["index"]), picture)


def test_texture_shows_upright(glb: Glb) -> None:
    """What a leaf samples from the picture is what it samples by the model's own v, which runs upward."""
    prototype = oak().atlas.prototypes[1]
    uv = glb.primitive(glb.node("leaf_01")["mesh"])["TEXCOORD_0"]
    picture = glb.image(glb.material_of(glb.node("leaf_01"))["index"])
    height, width = picture.shape[:2]
    ours = oak().atlas.rgba[
        (height - prototype.uv[:, 1] * height).astype(int), (prototype.uv[:, 0] * width).astype(int)
    ]
    assert_array_equal(picture[(uv[:, 1] * height).astype(int), (uv[:, 0] * width).astype(int)], ours)


def test_who_does_not_know_instances_is_told(glb: Glb) -> None:
    assert glb.json["extensionsUsed"] == sorted([INSTANCING, LOD])
    assert glb.json["extensionsRequired"] == [INSTANCING]


def test_a_bare_tree_needs_no_extension(tmp_path: Path) -> None:
    model = tree_model(n_leaves=0, name="bare")
    glb = Glb(write_glb(model, [full_level(model)], tmp_path / "bare.glb"))
    assert [node["name"] for node in glb.json["nodes"]] == ["branches", "bare"]
    assert "extensionsUsed" not in glb.json


def test_plain_bark_is_a_linear_colour(tmp_path: Path) -> None:
    model = replace(oak(), bark=Bark(np.array([[[188, 0, 255]]], np.uint8), 1.0, 1.0))
    glb = Glb(write_glb(model, [full_level(model)], tmp_path / "oak.glb"))
    surface = glb.material_of(glb.node("branches"))["pbrMetallicRoughness"]
    assert_allclose(surface["baseColorFactor"], [0.5029, 0, 1, 1], atol=1e-4)
    assert "baseColorTexture" not in surface


def test_many_points_take_wide_indices(tmp_path: Path) -> None:
    points = np.random.default_rng(4).random((65_536, 3))
    faces = np.arange(65_535).reshape(-1, 3) + 1  # the last is index 65535, which short ones may not use
    mesh = Mesh(points, np.tile([0.0, 0, 1], (65_536, 1)), points[:, :2], faces)
    model = tree_model(n_leaves=0, mesh=mesh)
    glb = Glb(write_glb(model, [full_level(model)], tmp_path / "oak.glb"))
    assert_array_equal(glb.primitive(0)["faces"], faces)
    assert glb.json["accessors"][glb.json["meshes"][0]["primitives"][0]["indices"]]["componentType"] == 5125


def test_same_tree_same_bytes(path: Path, tmp_path: Path) -> None:
    again = write_glb(oak(), levels_of(oak()), tmp_path / "other.glb", card_rgba=CARD_RGBA)
    assert again.read_bytes() == path.read_bytes()


def test_trimesh_sees_the_same_box(tmp_path: Path) -> None:
    model = oak()
    scene = trimesh.load_scene(write_glb(model, [full_level(model)], tmp_path / "oak.glb", instancing=False))
    every = np.concatenate([model.mesh.points, flat_leaves(model.leaves, model.atlas.prototypes)[0].points])
    assert_allclose(scene.bounds, [every.min(axis=0), every.max(axis=0)], atol=1e-6)
    assert sum(len(mesh.faces) for mesh in scene.geometry.values()) == full_level(model).n_triangles


def test_a_scene_holds_each_tree_once(tmp_path: Path) -> None:
    bare = tree_model(n_leaves=0, name="bare")
    trees = {
        "oak": Subject(oak(), levels_of(oak()), CARD_RGBA),
        "bare": Subject(bare, (full_level(bare),)),
    }
    forest = Forest(
        prototypes=("oak", "bare"),
        names=("oak", "bare", "oak_copy"),
        prototype=np.array([0, 1, 0]),
        position=np.array([[1.0, 0.0, 2.0], [7.0, 0.5, 0.0], [-3.0, 0.0, -4.0]]),
        yaw=np.radians([0.0, 40.0, 90.0]),
        scale=np.array([1.0, 1.0, 0.5]),
    )
    glb = Glb(write_scene_glb(trees, forest, tmp_path / "wood.glb"))
    nodes = glb.json["nodes"]
    roots = [nodes[k] for k in glb.json["scenes"][0]["nodes"]]
    assert [root["name"] for root in roots] == ["oak", "bare", "oak_copy"]
    assert_allclose(Rotation.from_quat(roots[2]["rotation"]).apply([0, 0, 1]), [1, 0, 0], atol=1e-12)
    assert (roots[2]["translation"], roots[2]["scale"]) == ([-3.0, 0.0, -4.0], [0.5, 0.5, 0.5])
    first, _, copy = ([nodes[k].get("mesh") for k in root["children"]] for root in roots)
    assert first == copy
    coarser = nodes[roots[2]["extensions"][LOD]["ids"][0]]
    assert coarser["name"] == "oak_copy_LOD1"
    assert coarser["translation"] == roots[2]["translation"], "a coarser level stands where its tree does"


def test_a_wood_is_instances_of_each_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where more stand than may have nodes of their own: all standings of a part in one node."""
    monkeypatch.setattr(gltf, "MOST_STANDING", 4)
    model, n = oak(), 5
    rng = np.random.default_rng(8)
    forest = Forest(
        prototypes=("oak", "unused"),
        names=tuple(f"oak_{k}" for k in range(n)),
        prototype=np.zeros(n, int),
        position=rng.normal(size=(n, 3)),
        yaw=rng.uniform(0, 6, n),
        scale=rng.uniform(0.5, 2, n),
    )
    glb = Glb(write_scene_glb({"oak": Subject(model, levels_of(model), CARD_RGBA)}, forest, tmp_path / "wood.glb"))
    assert [node["name"] for node in glb.json["nodes"]] == ["branches", "leaf_00", "leaf_01", "leaf_02", "oak"]
    found = np.concatenate([matrices(glb, f"leaf_{k:02d}") for k in range(3)])
    trees = matrices(glb, "branches")
    assert_allclose(trees[:, :3, 3], forest.position, atol=1e-6)
    alone = Glb(write_glb(model, [full_level(model)], tmp_path / "oak.glb"))
    expected = np.concatenate([trees[:, None] @ matrices(alone, f"leaf_{k:02d}") for k in range(3)], axis=1)
    order = np.lexsort(found[:, :3, 3].round(3).T)
    expected = expected.reshape(-1, 4, 4)
    assert_allclose(found[order], expected[np.lexsort(expected[:, :3, 3].round(3).T)], atol=2e-4)


def matrices(glb: Glb, name: str) -> NDArray[np.float64]:
    """A node's instances (K, 4, 4), for column vectors."""
    attributes = glb.node(name)["extensions"][INSTANCING]["attributes"]
    place = np.tile(np.eye(4), (len(glb.array(attributes["SCALE"])), 1, 1))
    turn = Rotation.from_quat(glb.array(attributes["ROTATION"])).as_matrix()
    place[:, :3, :3] = turn * glb.array(attributes["SCALE"])[:, None]
    place[:, :3, 3] = glb.array(attributes["TRANSLATION"])
    return place


class TestRefused:
    """Each with its reason; nothing is left behind."""

    @pytest.fixture(autouse=True)
    def _nothing_is_left(self, tmp_path: Path) -> None:
        self.folder = tmp_path

    def refuse(self, message: str, *, error: type[Exception] = InputError, **changes: object) -> None:
        model = oak()
        arguments = {"model": model, "levels": [full_level(model)], "path": self.folder / "oak.glb"} | changes
        with pytest.raises(error, match=message):
            write_glb(**arguments)  # type: ignore[arg-type]
        assert sorted(entry.name for entry in self.folder.iterdir() if entry.name != "kept") == []

    def test_leaves_without_an_atlas(self) -> None:
        self.refuse("oak: has 50 leaves but no leaf atlas", model=without_atlas(oak()))

    def test_cards_without_a_picture(self) -> None:
        self.refuse("oak: level 2 has cards but no card atlas", levels=levels_of(oak()))

    def test_nothing_to_draw(self) -> None:
        bare = replace(full_level(tree_model(n_leaves=0)), mesh=EMPTY_MESH)
        self.refuse("level 0 has nothing to draw", levels=[bare])

    def test_no_level(self) -> None:
        self.refuse("at least one level", levels=[], error=ValueError)

    def test_levels_out_of_order(self) -> None:
        full, coarse, _ = levels_of(oak())
        self.refuse("ever smaller sizes", levels=[coarse, full], error=ValueError)

    def test_a_point_that_is_nowhere(self) -> None:
        model = broken(oak())
        self.refuse("points of a mesh hold NaN", model=model, levels=[full_level(model)], error=ValueError)

    def test_another_suffix(self) -> None:
        self.refuse("expected a name that ends in .glb", path=self.folder / "oak.gltf")

    def test_a_folder_of_that_name(self) -> None:
        (self.folder / "kept").mkdir()
        (self.folder / "kept" / "oak.glb").mkdir()
        self.refuse("is a folder", path=self.folder / "kept" / "oak.glb")
        assert (self.folder / "kept" / "oak.glb").is_dir()

    def test_a_file_where_a_folder_should_be(self) -> None:
        (self.folder / "kept").write_text("not a folder")
        self.refuse("kept", path=self.folder / "kept" / "oak.glb", error=OSError)

    def test_a_scene_without_its_tree(self) -> None:
        forest = Forest(("elm",), ("elm",), np.zeros(1, int), np.zeros((1, 3)), np.zeros(1), np.ones(1))
        with pytest.raises(InputError, match="there is no tree 'elm' to place"):
            write_scene_glb({}, forest, self.folder / "wood.glb")


def test_too_many_leaves_for_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gltf, "MOST_STANDING", 1)
    monkeypatch.setattr(gltf, "MOST_INSTANCES", 99)
    forest = Forest(("oak",), ("a", "b"), np.zeros(2, int), np.zeros((2, 3)), np.zeros(2), np.ones(2))
    trees = {"oak": Subject(oak(), (full_level(oak()),))}
    with pytest.raises(InputError, match=r"100 leaves are too many for one file \(at most 99\)"):
        write_scene_glb(trees, forest, tmp_path / "wood.glb")
    flat = Glb(write_scene_glb(trees, forest, tmp_path / "wood.glb", instancing=False))
    assert [len(matrices(flat, name)) for name in ("branches", "leaves")] == [2, 2]


def test_an_earlier_file_stays_where_the_new_one_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "oak.glb"
    path.write_bytes(b"earlier")
    level: Level = full_level(oak())

    def full_disk(*_: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full_disk)
    with pytest.raises(OSError, match="No space left"):
        write_glb(oak(), [level], path)
    assert [(entry.name, entry.read_bytes()) for entry in tmp_path.iterdir()] == [("oak.glb", b"earlier")]
