"""Card textures: they lie on USD's cards as the tree stands, and no validator minds them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pxr import Usd, UsdGeom

from forestgen.camera import Camera
from forestgen.check.metrics import iou
from forestgen.png import write_png
from forestgen.render import Drawable, Studio
from forestgen.render.model_drawables import level_drawables
from forestgen.render.side_cards import FACES, side_cards
from forestgen.tree.level import full_level
from forestgen.tree.model import Mesh, TreeModel
from forestgen.usd.card_textures import AXES, card_name, define_draw_mode
from forestgen.usd.tree_asset import write_tree_asset
from forestgen.usd.validate import validate
from tests.render.small_trees import forked_tree

# Where UsdImaging's card of a face puts the corners (s, t) = (0, 0), (1, 0), (1, 1), (0, 1) of its picture, in the
# unit box: from _ComputePoints and _ComputeUVs in pxr/usdImaging/usdImaging/drawModeStandin.cpp.
CORNERS = {
    "XPos": [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]],
    "XNeg": [[0, 1, 0], [0, 0, 0], [0, 0, 1], [0, 1, 1]],
    "YPos": [[1, 1, 0], [0, 1, 0], [0, 1, 1], [1, 1, 1]],
    "YNeg": [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
    "ZPos": [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    "ZNeg": [[0, 1, 0], [1, 1, 0], [1, 0, 0], [0, 0, 0]],
}
BEFORE = {  # azimuth and elevation, degrees, of someone who looks straight onto the face
    "XPos": (90, 0),
    "XNeg": (-90, 0),
    "YPos": (0, 90),
    "YNeg": (0, -90),
    "ZPos": (0, 0),
    "ZNeg": (180, 0),
}


def box_of(model: TreeModel) -> np.ndarray:
    """The box (2, 3) around wood and leaves, with a little room."""
    points = np.concatenate([model.mesh.points, model.leaves.position])
    return np.array([points.min(axis=0) - 0.15, points.max(axis=0) + 0.15])


def pictures_of(model: TreeModel) -> dict[str, np.ndarray]:
    return side_cards(model, box_of(model), [model.atlas.rgba], longest=256)[0]


def seen(drawables: list[Drawable], face: str) -> np.ndarray:
    azimuth, elevation = np.radians(BEFORE[face])
    with Studio(drawables) as studio:
        return studio.colour(Camera((300, 300), (150.0, 220.0), 50.0, azimuth, elevation))


@pytest.mark.gl
@pytest.mark.parametrize("face", AXES)
def test_each_picture_lies_on_usds_card_as_the_tree_stands(face):
    model = forked_tree(800)
    picture, box = pictures_of(model)[face], box_of(model)
    corner = np.array(CORNERS[face], float)
    axis = "XYZ".index(face[0])
    corner[:, axis] = 0.5  # cross: the card halves the box
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    ahead = np.cross(corner[1] - corner[0], corner[2] - corner[0])
    assert ahead[axis] == (1 if face.endswith("Pos") else -1), "the card faces outwards"
    card = Drawable(
        name="card",
        points=box[0] + corner * (box[1] - box[0]),
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
        uv=uv,
        texture=picture,
    )
    full = seen(level_drawables(full_level(model), model.bark, model.atlas.rgba), face)
    shown = seen([card], face)
    assert iou(full[..., 3] >= 0.5, shown[..., 3] >= 0.5) >= 0.93
    both = (full[..., 3] == 1) & (shown[..., 3] == 1)
    assert np.abs(full - shown)[both].mean() < 0.03
    for turned in (np.rot90(picture, 2), picture[:, ::-1], picture[::-1]):
        wrong = seen([replace(card, texture=np.ascontiguousarray(turned))], face)
        assert iou(full[..., 3] >= 0.5, wrong[..., 3] >= 0.5) < 0.85


@pytest.mark.gl
def test_pictures_fill_their_faces_from_edge_to_edge():
    """A tree that is a box as large as the box given: every texel of every picture is covered."""
    model = forked_tree(0)
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) * [2.0, 3.1, 0.7] - [
        1,
        0,
        0.2,
    ]
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([f for a, b, c, d in quads for f in ([a, b, c], [a, c, d])])
    solid = Mesh(corner, np.tile([0.0, 0.0, 1.0], (8, 1)), corner[:, :2], faces)
    box = [corner.min(axis=0), corner.max(axis=0)]
    pictures = side_cards(replace(model, mesh=solid), box, [None], longest=64)[0]
    sizes = {face: picture.shape[:2] for face, picture in pictures.items()}
    width, height, depth = 42, 64, 15
    assert sizes == {  # rows, columns
        **dict.fromkeys(("XPos", "XNeg"), (depth, height)),
        **dict.fromkeys(("YPos", "YNeg"), (depth, width)),
        **dict.fromkeys(("ZPos", "ZNeg"), (height, width)),
    }
    assert all((picture[..., 3] == 255).all() for picture in pictures.values())


@pytest.mark.gl
def test_pictures_are_cut_out_sharply_and_the_same_again():
    first, second = (pictures_of(forked_tree(100)) for _ in range(2))
    assert list(first) == list(FACES)
    for face in FACES:
        assert set(np.unique(first[face][..., 3])) == {0, 255}
        assert first[face].tobytes() == second[face].tobytes()


@pytest.mark.gl
def test_a_bare_tree_and_one_leaf_have_cards_too():
    for n_leaves in (0, 1):
        pictures = pictures_of(forked_tree(n_leaves))
        assert all((picture[..., 3] > 0).any() for picture in pictures.values())


def test_a_flat_box_is_refused():
    with pytest.raises(ValueError, match="needs an extent along each axis"):
        side_cards(forked_tree(0), [[0, 0, 0], [1, 0, 1]], [None])


def with_cards(folder: Path, *, n_leaves: int = 60, longest: int = 64) -> Path:
    """A written tree with its draw mode."""
    model = forked_tree(n_leaves)
    path = write_tree_asset(model, folder / "forked")
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetDefaultPrim()
    box = np.array(UsdGeom.ModelAPI(prim).GetExtentsHint())
    for face, picture in side_cards(model, box, [model.atlas.rgba], longest=longest)[0].items():
        write_png(path.parent / "textures" / f"{card_name(face)}.png", picture)
    define_draw_mode(prim, {face: f"./textures/{card_name(face)}.png" for face in AXES}, [0.3, 0.5, 0.2])
    stage.Save()
    return path


@pytest.mark.gl
def test_one_attribute_switches_to_cards_and_no_validator_minds(tmp_path):
    path = with_cards(tmp_path)
    assert validate(path) == []
    nvidia = pytest.importorskip("usd_validation_nvidia")
    assert list(nvidia.ValidationEngine().validate(str(path)).issues()) == []
    stage = Usd.Stage.Open(str(path))
    model = UsdGeom.ModelAPI(stage.GetDefaultPrim())
    assert not model.GetModelDrawModeAttr().IsAuthored()
    assert model.ComputeModelDrawMode() == UsdGeom.Tokens.default_
    assert model.GetModelApplyDrawModeAttr().Get() is True
    assert model.GetModelCardGeometryAttr().Get() == UsdGeom.Tokens.cross
    model.GetModelDrawModeAttr().Set(UsdGeom.Tokens.cards)
    assert model.ComputeModelDrawMode() == UsdGeom.Tokens.cards
    for face in AXES:
        asset = stage.GetDefaultPrim().GetAttribute(f"model:cardTexture{face}").Get()
        assert asset.path.startswith("./textures/card_")
        assert Path(asset.resolvedPath).is_file()


@pytest.mark.gl
def test_the_same_bytes_again(tmp_path):
    first, second = (with_cards(tmp_path / name) for name in ("a", "b"))
    for face in AXES:
        name = f"textures/{card_name(face)}.png"
        assert (first.parent / name).read_bytes() == (second.parent / name).read_bytes()
    assert first.read_bytes() == second.read_bytes()


def test_a_missing_face_is_refused_and_nothing_authored():
    stage = Usd.Stage.CreateInMemory()
    prim = UsdGeom.Xform.Define(stage, "/oak").GetPrim()
    with pytest.raises(ValueError, match=r"/oak: card textures for \['XPos'\]"):
        define_draw_mode(prim, {"XPos": "./a.png"}, [0, 0, 0])
    assert prim.GetAppliedSchemas() == []


def test_the_colour_is_written_linear():
    stage = Usd.Stage.CreateInMemory()
    prim = UsdGeom.Xform.Define(stage, "/oak").GetPrim()
    define_draw_mode(prim, dict.fromkeys(AXES, "./a.png"), [1.0, 0.5, 0.0])
    colour = UsdGeom.ModelAPI(prim).GetModelDrawModeColorAttr().Get()
    assert_allclose(colour, [1.0, 0.2140411, 0.0], atol=1e-6)
