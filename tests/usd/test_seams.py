"""Seams of a texture: meshes are stored closed, and come back as they were."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Bark, Mesh
from forestgen.usd.geometry import define_mesh
from forestgen.usd.layers import new_stage, open_stage, save
from forestgen.usd.polygons import read_triangles
from forestgen.usd.seams import weld
from tests.tree.skeletons import random_tree
from tests.usd.models import box_mesh

BARK = Bark(np.full((1, 1, 3), 90, np.uint8), 0.3, 0.3)


@pytest.fixture(scope="module")
def wood() -> Mesh:
    """Tubes with a seam each."""
    return GeneralisedCylinders()(random_tree(200, rng=np.random.default_rng(5)), BARK)


def written(mesh: Mesh, path: Path, *, by_corner: bool = False) -> Usd.Stage:
    """A mesh as /oak, written and opened again."""
    stage = new_stage("oak")
    define_mesh(stage, Sdf.Path("/oak"), mesh, Sdf.Path("/oak/bark"), by_corner=by_corner)
    save(stage.GetRootLayer(), path)
    return open_stage(path)


def edges(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """How many faces share each edge."""
    ends = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    return np.unique(ends, axis=0, return_counts=True)[1]


def test_wood_is_stored_closed(wood: Mesh, tmp_path: Path) -> None:
    stage = written(wood, tmp_path / "wood.usdc")
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/oak"))
    faces = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    assert edges(wood.faces).min() == 1  # open along the seams
    assert_array_equal(np.unique(edges(faces)), [2])
    points = np.array(mesh.GetPointsAttr().Get())
    assert len(points) < 0.9 * len(wood.points)
    assert len(mesh.GetNormalsAttr().Get()) == len(points) == len(np.unique(points, axis=0))
    assert_array_equal(points[faces], wood.points.astype(np.float32)[wood.faces])
    st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    assert st.GetInterpolation() == UsdGeom.Tokens.faceVarying
    assert len(st.Get()) == len(wood.points)
    assert_array_equal(st.ComputeFlattened(), wood.uv.astype(np.float32)[wood.faces.ravel()])


def test_wood_comes_back_as_it_was(wood: Mesh, tmp_path: Path) -> None:
    stage = written(wood, tmp_path / "wood.usdc")
    back = read_triangles(stage.GetPrimAtPath("/oak"), Usd.TimeCode.Default())
    assert back is not None
    assert back.normals is not None
    assert_array_equal(back.faces, wood.faces)
    assert_array_equal(back.points, wood.points.astype(np.float32))
    assert_array_equal(back.uv("st"), wood.uv.astype(np.float32))
    assert_array_equal(back.stored, weld(wood).stored)
    np.testing.assert_allclose(back.normals, wood.normals, atol=1e-6)


def test_what_has_no_seam_stays_by_point_unless_it_is_asked_for(tmp_path: Path) -> None:
    box = box_mesh(1.0, 2.0)
    for by_corner, kind in ((False, UsdGeom.Tokens.vertex), (True, UsdGeom.Tokens.faceVarying)):
        stage = written(box, tmp_path / f"{kind}.usdc", by_corner=by_corner)
        prim = stage.GetPrimAtPath("/oak")
        st = UsdGeom.PrimvarsAPI(prim).GetPrimvar("st")
        assert st.GetInterpolation() == kind
        assert len(st.Get()) == 4  # the box's uv repeat
        back = read_triangles(prim, Usd.TimeCode.Default())
        assert back is not None
        uv = back.uv("st")
        assert uv is not None
        assert len(back.points) == 8
        assert_array_equal(back.points[back.faces], box.points.astype(np.float32)[box.faces])
        assert_array_equal(uv[back.faces], box.uv.astype(np.float32)[box.faces])


@pytest.mark.parametrize(
    ("entry", "stands"),
    [
        ([0, 1, 2, 0, 2, 3], 4),  # each coordinate is of one point
        ([0, 1, 0, 0, 0, 1], 4),  # two points share coordinates
        ([0, 1, 2, 3, 2, 4], 5),  # point 0 has two
        ([0, 1, 2, 0, 2, 9], 4),  # some are of no point
    ],
)
def test_a_point_stands_as_often_as_it_has_coordinates(entry: list[int], stands: int) -> None:
    stage = Usd.Stage.CreateInMemory()
    mesh = UsdGeom.Mesh.Define(stage, "/square")
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    mesh.CreatePointsAttr(square.tolist())
    mesh.CreateFaceVertexCountsAttr([3, 3])
    mesh.CreateFaceVertexIndicesAttr(faces.ravel().tolist())
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
    value = np.column_stack([np.arange(10), np.zeros(10)])
    st.Set(value.tolist())
    st.SetIndices(entry)
    back = read_triangles(mesh.GetPrim(), Usd.TimeCode.Default())
    assert back is not None
    uv = back.uv("st")
    assert uv is not None
    assert len(back.points) == len(uv) == stands
    assert_array_equal(back.points[back.faces], square[faces])
    assert_array_equal(uv[back.faces].reshape(-1, 2), value[entry])
    assert_array_equal(square[back.stored], back.points)


def test_welding_keeps_every_corner_and_no_point_twice() -> None:
    part = box_mesh(1.0, 2.0)
    rng = np.random.default_rng(2)
    split = Mesh(  # each corner a point of its own, with its own uv, in any order
        points=part.points[part.faces].reshape(-1, 3),
        normals=part.normals[part.faces].reshape(-1, 3),
        uv=rng.random((36, 2)),
        faces=rng.permutation(36).reshape(-1, 3),
    )
    welded = weld(split)
    assert welded.has_seams
    assert_array_equal(welded.kept, np.sort(np.unique(split.points, axis=0, return_index=True)[1]))
    assert_array_equal(split.points[welded.kept][welded.stored], split.points)
    assert_array_equal(split.normals[welded.kept][welded.stored], split.normals)


def test_points_of_one_place_with_two_normals_stay_two() -> None:
    up = np.array([[0, 0, 1.0], [0, 0, 1.0], [0, 1.0, -0.0]])
    twice = Mesh(np.zeros((3, 3)), up, np.zeros((3, 2)), np.array([[0, 1, 2]]))
    assert_array_equal(weld(twice).stored, [0, 0, 1])
    assert_array_equal(weld(twice).kept, [0, 2])
    signed = replace(twice, points=np.array([[0.0, 0, 0], [-0.0, 0, 0], [0, 0, 0]]))
    assert_array_equal(weld(signed).stored, [0, 0, 1])
