"""Reading: our own stages, and stages that nobody here wrote."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from pxr import Usd

from forestgen.camera import Camera
from forestgen.errors import InputError
from forestgen.render.drawable import Drawable
from forestgen.tree.model import Leaves
from forestgen.usd.polygons import fan
from forestgen.usd.read import read_drawables
from forestgen.usd.tree_asset import write_tree_asset
from tests.usd.conftest import FOREST
from tests.usd.models import tree_model

DATA = Path(__file__).parent / "data"
HALF = 1e-3  # what half-float quaternions leave of exactness, on leaves of up to 0.2 m times 2


def triangles(drawables: list[Drawable]) -> NDArray[np.float64]:
    """Every triangle drawn (T, 3, 3), in metres of the world, in a canonical order; winding is lost."""
    drawn = [
        np.einsum("kij,fvj->kfvi", d.transforms[:, :3, :3], d.points[d.faces]) + d.transforms[:, None, None, :3, 3]
        for d in drawables
    ]
    return ordered(np.concatenate([part.reshape(-1, 3, 3) for part in drawn]))


def ordered(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    key = np.round(triangles, 4)  # by corners within each triangle, then by triangles
    corner = np.lexsort((key[..., 2], key[..., 1], key[..., 0]), axis=1)
    triangles = np.take_along_axis(triangles, corner[..., None], axis=1)
    return triangles[np.lexsort(np.round(triangles.mean(axis=1), 5).T)]


def quaternion_turn(q: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """v turned by w x y z, from the definition: v + 2w (u x v) + 2 u x (u x v)."""
    return v + 2 * q[0] * np.cross(q[1:], v) + 2 * np.cross(q[1:], np.cross(q[1:], v))


def test_our_tree_comes_back_triangle_by_triangle(oak: Path) -> None:
    model = tree_model()
    drawables = read_drawables(oak)
    assert [d.is_leaf for d in drawables] == [False, True, True, True]
    assert sum(len(d.transforms) for d in drawables) == 1 + len(model.leaves)
    leaves = model.leaves
    expected = [model.mesh.points[model.mesh.faces]]
    for k in range(len(leaves)):
        leaf = model.atlas.prototypes[leaves.prototype[k]]
        corners = quaternion_turn(leaves.orientation[k], leaf.points[leaf.faces])
        expected.append(leaves.position[k] + leaves.size[k] * corners)
    assert_allclose(triangles(drawables), ordered(np.concatenate(expected)), atol=HALF)


def test_a_leaf_shows_in_the_photo_where_it_was_meant_to(tmp_path: Path) -> None:
    # From pixels to a leaf, through the file, back to pixels: foot at one place, tip at another.
    camera = Camera((400, 300), (180.0, 280.0), 90.0, np.radians(50), np.radians(10))
    foot, tip = camera.unproject([[120.0, 90.0], [150.0, 60.0]], [0.3, 0.3])
    blade = (tip - foot) / np.linalg.norm(tip - foot)
    turn = np.array([1 + blade[1], *np.cross([0, 1, 0], blade)])  # the shortest way from +Y to the blade
    leaves = Leaves(
        position=foot[None],
        orientation=(turn / np.linalg.norm(turn))[None],
        size=np.array([np.linalg.norm(tip - foot)]),
        prototype=np.array([0]),
    )
    leaf = read_drawables(write_tree_asset(tree_model(leaves=leaves, n_prototypes=1), tmp_path / "oak"))[1]
    shown = np.array([[0, 0, 0, 1], [0, 1, 0, 1]]) @ leaf.transforms[0].T
    assert_allclose(camera.project(shown[:, :3]), [[120, 90], [150, 60]], atol=0.1)


def test_surfaces_come_back(oak: Path) -> None:
    model = tree_model()
    wood, leaf, *others = read_drawables(oak)
    assert leaf.texture is not None
    assert wood.texture is not None
    assert_array_equal(leaf.texture, model.atlas.rgba)
    assert_array_equal(wood.texture[..., :3], model.bark.rgb)
    assert (wood.texture[..., 3] == 255).all()
    assert leaf.alpha_threshold == 0.5
    assert leaf.uv is not None
    assert_allclose(leaf.uv, model.atlas.prototypes[0].uv, atol=1e-6)
    assert all(other.texture is leaf.texture for other in others)  # one picture for all


def test_a_scene_draws_each_mesh_once_at_all_its_places(scene: Path) -> None:
    drawables = read_drawables(scene)
    wood = next(d for d in drawables if d.name == "/wood/trees/oak/geo/LOD0/branches")
    assert len(drawables) == 6  # oak's branches and three leaves, bare's branches, the ground
    assert_allclose(wood.transforms[:, :3, 3], FOREST.position[[0, 2]], atol=1e-6)
    assert_allclose(np.linalg.det(wood.transforms[:, :3, :3]), [1, 0.9**3], atol=1e-6)
    leaves = sum(len(d.transforms) for d in drawables if d.is_leaf)
    assert leaves == 2 * 50


def test_one_tree_of_a_scene_stands_where_it_stands(scene: Path) -> None:
    (wood,) = read_drawables(scene, "/wood/trees/bare")
    assert_allclose(wood.transforms[0, :3, 3], FOREST.position[1], atol=1e-6)
    assert not wood.is_leaf
    with pytest.raises(InputError, match="there is no prim /wood/none"):
        read_drawables(scene, "/wood/none")


@pytest.fixture(scope="session")
def score_tree(shared: Path) -> ModuleType:
    """The independent scorer: its own reader is the oracle."""
    spec = importlib.util.spec_from_file_location("score_tree", shared / "tools" / "score_tree.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("which", ["oak", "scene", "foreign"])
def test_reads_what_the_independent_scorer_reads(
    which: str, scene: Path, oak: Path, foreign: Path, score_tree: ModuleType
) -> None:
    path = {"oak": oak, "scene": scene, "foreign": foreign}[which]
    theirs = score_tree.collect(Usd.Stage.Open(str(path)))
    expected = ordered(np.concatenate([part[0] for part in theirs]))
    ours = read_drawables(path)
    assert_allclose(triangles(ours), expected, atol=1e-5)
    n_leaf = sum(len(part[0]) for part in theirs if part[3])
    assert sum(d.n_triangles for d in ours if d.is_leaf) == n_leaf


@pytest.fixture(scope="session")
def foreign() -> Path:
    """A stage with everything that our own writer never writes."""
    return DATA / "foreign.usda"


def named(drawables: list[Drawable], word: str) -> Drawable:
    (found,) = (d for d in drawables if word in d.name)
    return found


def test_a_foreign_stage_in_centimetres_with_z_up(foreign: Path) -> None:
    drawables = read_drawables(foreign)
    shown = {"needles", "leaf", "pentagon_and_triangle", "not_turned_with_the_world"}
    assert {d.name.split("/")[-1] for d in drawables} == shown
    assert_allclose(named(drawables, "not_turned").transforms[0, :3, 3], [1, 0, 0], atol=1e-9)
    bush = [d for d in drawables if d.name.endswith("needles")]
    feet = np.concatenate([d.transforms[:, :3, 3] for d in bush])
    # cm, Z up, turned by 90 degrees about Z: (x, y, z) lies at (-y, z, -x) / 100
    expected = [[0, 0, -3], [-4, 0, 0], [0, 0.5, 0]]  # a at its last frame, b, first of the clump
    assert_allclose(feet[np.lexsort(feet.T)], np.array(expected)[np.lexsort(np.array(expected).T)], atol=1e-9)


def test_nested_instancers_multiply_and_masks_hold(foreign: Path) -> None:
    leaf = named(read_drawables(foreign), "/leaf")
    assert len(leaf.transforms) == 2 * 3
    assert_allclose(leaf.transforms[0] @ [0, 0, 0, 1], [-0.01, 0.02, -1, 1], atol=1e-9)
    assert_allclose(leaf.transforms[5] @ [0, 0, 1, 1], [-0.01, 0.02 + 0.05 + 0.07 + 0.03, -5, 1], atol=1e-9)


def test_left_handed_faces_are_turned_over(foreign: Path) -> None:
    assert_array_equal(named(read_drawables(foreign), "/leaf").faces, [[2, 1, 0]])


def test_polygons_become_fans_and_corners_keep_their_uv(foreign: Path) -> None:
    shape = named(read_drawables(foreign), "pentagon")
    assert len(shape.faces) == 3 + 1
    assert len(shape.points) == 8  # a point for each corner, since uv differ by corner
    assert_allclose(shape.colour, [0.735, 0.735, 0.735, 1], atol=1e-3)  # sRGB of linear one half


def test_fans_by_hand() -> None:
    corner, polygon = fan(np.array([3, 2, 5, 0, 4]))
    assert corner.tolist() == [[0, 1, 2], [5, 6, 7], [5, 7, 8], [5, 8, 9], [10, 11, 12], [10, 12, 13]]
    assert polygon.tolist() == [0, 2, 2, 2, 4, 4]


@pytest.fixture
def looks(tmp_path: Path) -> Path:
    """A card with two materials: one of two textures that are moved, one plain."""
    rgb = np.full((4, 4, 3), [255, 200, 100], np.uint8)
    mask = np.zeros((8, 8), np.uint16)
    mask[:, 4:] = 65535
    cv2.imwrite(str(tmp_path / "rgb.png"), rgb[..., ::-1])
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    path = tmp_path / "looks.usda"
    path.write_bytes((DATA / "looks.usda").read_bytes())
    return path


def test_separate_masks_moved_coordinates_and_material_subsets(looks: Path) -> None:
    second, first = read_drawables(looks)
    assert first.texture is not None
    assert first.texture.shape == (4, 4, 4)
    assert_allclose(first.texture[0, 0, :3], [188, 200, 100], atol=1)  # half the red light of 255
    assert_array_equal(first.texture[0, :, 3], [0, 0, 255, 255])
    assert first.alpha_threshold == pytest.approx(0.3)
    assert first.uv is not None
    corner = first.uv[first.faces[0]]  # (u, v) -> scaled (2u, v) -> turned (-v, 2u) -> shifted
    assert_allclose(corner, [[0.25, 0], [0.25, 2], [-0.75, 2]], atol=1e-6)
    assert first.normals is not None
    assert_allclose(first.normals, np.tile([0, 0, 1.0], (len(first.points), 1)))
    assert second.texture is None
    assert_allclose(second.colour, [1, 0, 0.735, 0.25], atol=1e-3)
    assert len(first.faces) == len(second.faces) == 1


def test_missing_textures_and_layers_are_named(looks: Path) -> None:
    (looks.parent / "rgb.png").unlink()
    with pytest.raises(InputError, match=r"/m/cut/rgb: inputs:file leads to ./rgb.png, which is not there"):
        read_drawables(looks)
    (looks.parent / "rgb.png").write_text("no picture")
    with pytest.raises(InputError, match="is no picture"):
        read_drawables(looks)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('def Xform "a" (references = @./gone.usda@) {}', "gone.usda"),
        (
            'def Mesh "a" { int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 9]\npoint3f[] points = '
            "[(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n}",
            "/a: faceVertexCounts and faceVertexIndices do not fit 3 points",
        ),
        (
            'def PointInstancer "a" { rel prototypes = </a/b>\nint[] protoIndices = [0, 1]\npoint3f[] positions = '
            '[(0, 0, 0), (1, 0, 0)]\ndef Mesh "b" {}\n}',
            "/a: protoIndices run to 1, but there are 1 prototypes",
        ),
        (
            'def PointInstancer "a" { rel prototypes = </a/b>\nint[] protoIndices = [0]\npoint3f[] positions = '
            "[(0, 0, 0)]\n}",
            "/a: there is no prototype /a/b",
        ),
        (
            'def Mesh "a" { int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]\npoint3f[] points = '
            '[(0, 0, 0), (1, 0, 0), (0, 1, 0)]\nnormal3f[] normals = [(0, 0, 1)] (interpolation = "vertex")\n}',
            "/a: an attribute of vertex interpolation is too short",
        ),
    ],
)
def test_broken_stages_are_refused_with_the_place(tmp_path: Path, body: str, message: str) -> None:
    path = tmp_path / "broken.usda"
    path.write_text(f"#usda 1.0\n{body}\n")
    with pytest.raises(InputError, match=message):
        read_drawables(path)


def test_a_tree_called_leafy_still_has_wood(tmp_path: Path) -> None:
    path = write_tree_asset(tree_model(), tmp_path / "leafy_needle_oak")
    assert [d.is_leaf for d in read_drawables(path)] == [False, True, True, True]


def test_what_was_written_anew_is_read_anew(tmp_path: Path) -> None:
    path = write_tree_asset(tree_model(n_leaves=50), tmp_path / "oak")
    held = Usd.Stage.Open(str(path))
    write_tree_asset(tree_model(n_leaves=7), tmp_path / "oak")
    assert sum(len(d.transforms) for d in read_drawables(path) if d.is_leaf) == 7
    assert held
