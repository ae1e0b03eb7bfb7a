"""Geometry: whole prims from whole arrays, each with its extent, normals, `st` and material."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from forestgen.tree.level import Level
from forestgen.tree.model import LeafPrototype, Leaves, Mesh
from forestgen.tree.places import rotation_matrix
from forestgen.usd.seams import weld

Box = NDArray[np.float32]  # (2, 3): low and high corner, m


def box_of(points: ArrayLike) -> Box:
    """The box (2, 3) around points (N, 3), in the float32 that USD stores."""
    stored = np.asarray(points, np.float32)
    return np.stack([stored.min(axis=0), stored.max(axis=0)])


def union(boxes: Sequence[Box]) -> Box:
    """The box (2, 3) around boxes."""
    every = np.stack(boxes)
    return np.stack([every[:, 0].min(axis=0), every[:, 1].max(axis=0)])


def vec3f(array: ArrayLike) -> Vt.Vec3fArray:
    """USD's own array of (N, 3) numbers."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(array, np.float32))


def bind(prim: Usd.Prim, material: Sdf.Path) -> None:
    """Bind a material by its path: it may live in another layer."""
    prim.AddAppliedSchema("MaterialBindingAPI")
    prim.CreateRelationship("material:binding", False).SetTargets([material])


def define_mesh(
    stage: Usd.Stage, path: Sdf.Path, mesh: Mesh | LeafPrototype, material: Sdf.Path, *, by_corner: bool = False
) -> Box:
    """Author triangles as a polygon mesh, closed at seams and seen from both sides; give its extent (2, 3).

    Texture coordinates are stored once each, by point, or by face corner where there are seams or it is asked for.

    Raises:
        ValueError: the mesh has no face, or numbers that are not finite; nothing is authored then.
    """
    if not len(mesh.faces):
        raise ValueError(f"{path}: a mesh without faces cannot be written")
    for name in ("points", "normals", "uv"):
        if not np.isfinite(getattr(mesh, name)).all():
            raise ValueError(f"{path}: {name} holds NaN")
    welded = weld(mesh)
    prim = UsdGeom.Mesh.Define(stage, path)
    prim.CreatePointsAttr(vec3f(mesh.points[welded.kept]))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32)))
    prim.CreateFaceVertexIndicesAttr(_ints(welded.stored[mesh.faces]))
    prim.CreateNormalsAttr(vec3f(mesh.normals[welded.kept]))
    prim.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    value, index = _distinct(mesh.uv)
    _author_st(prim, value, index[mesh.faces] if by_corner or welded.has_seams else index)
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateOrientationAttr(UsdGeom.Tokens.rightHanded)
    prim.CreateDoubleSidedAttr(True)
    box = box_of(mesh.points)
    prim.CreateExtentAttr(vec3f(box))
    bind(prim.GetPrim(), material)
    return box


def _author_st(prim: UsdGeom.Mesh, value: NDArray[np.float32], index: NDArray[np.int64]) -> None:
    """Author texture coordinates (D, 2) with an index by point (P,) or by corner (F, 3); by point none if D is P."""
    interpolation = UsdGeom.Tokens.faceVarying if index.ndim == 2 else UsdGeom.Tokens.vertex
    st = UsdGeom.PrimvarsAPI(prim).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, interpolation)
    st.Set(Vt.Vec2fArray.FromNumpy(value))
    if index.ndim == 2 or len(value) < len(index):
        st.SetIndices(_ints(index))


def _distinct(uv: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """The distinct rows (D, 2) of (P, 2) as float32, in the order of their first use, and which one each is (P,)."""
    value = np.ascontiguousarray(uv.astype(np.float32) + np.float32(0))  # no -0: it would hide a repetition
    _, first, index = np.unique(value.view(np.uint64).ravel(), return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return value[first[order]], rank[index]


def _ints(array: NDArray[np.int64]) -> Vt.IntArray:
    """USD's own array of whole numbers, of any shape, row after row."""
    return Vt.IntArray.FromNumpy(np.ascontiguousarray(array.ravel(), np.int32))


def define_leaves(
    stage: Usd.Stage, path: Sdf.Path, leaves: Leaves, prototypes: Sequence[LeafPrototype], material: Sdf.Path
) -> Box:
    """Author leaves as a point instancer whose prototypes are plain meshes; give its extent (2, 3).

    Raises:
        ValueError: no leaf, a prototype that does not exist, or a size that is no positive number;
            nothing is authored then.
    """
    if not len(leaves):
        raise ValueError(f"{path}: an instancer without instances cannot be written")
    if not (leaves.prototype.min() >= 0 and leaves.prototype.max() < len(prototypes)):
        raise ValueError(f"{path}: a leaf's prototype is not among the {len(prototypes)} of the atlas")
    if not (np.isfinite(leaves.position).all() and np.isfinite(leaves.size).all() and leaves.size.min() > 0):
        raise ValueError(f"{path}: leaves need finite positions and sizes above 0")

    instancer = UsdGeom.PointInstancer.Define(stage, path)
    home = UsdGeom.Scope.Define(stage, path.AppendChild("Prototypes")).GetPath()
    targets = [home.AppendChild(name) for name in prototype_names(len(prototypes))]
    for target, leaf in zip(targets, prototypes, strict=True):
        define_mesh(stage, target, leaf, material)
    instancer.CreatePrototypesRel().SetTargets(targets)
    size = leaves.size.astype(np.float32)
    instancer.CreateProtoIndicesAttr(_ints(leaves.prototype))
    instancer.CreatePositionsAttr(vec3f(leaves.position))
    instancer.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(stored_turn(leaves)))
    instancer.CreateScalesAttr(vec3f(np.repeat(size[:, None], 3, axis=1)))
    box = leaves_box(leaves, prototypes)
    instancer.CreateExtentAttr(vec3f(box))
    return box


def stored_turn(leaves: Leaves) -> NDArray[np.float16]:
    """Orientations (L, 4) as USD stores them: i, j, k, REAL. Rows with the real part first would become other
    rotations without a word."""
    return leaves.orientation[:, [1, 2, 3, 0]].astype(np.float16)


def leaves_box(leaves: Leaves, prototypes: Sequence[LeafPrototype]) -> Box:
    """The box (2, 3) around leaves, from the numbers that are stored."""
    boxes = np.stack([box_of(prototype.points) for prototype in prototypes])
    return instances_box(leaves.position, stored_turn(leaves), leaves.size.astype(np.float32), boxes[leaves.prototype])


def level_box(level: Level) -> Box:
    """The box (2, 3) around all that a level of detail shows.

    Raises:
        ValueError: it shows nothing.
    """
    boxes = [box_of(mesh.points) for mesh in (level.mesh, level.cards) if len(mesh.points)]
    if len(level.leaves):
        boxes.append(leaves_box(level.leaves, level.prototypes))
    if not boxes:
        raise ValueError("a level of detail that shows nothing has no box")
    return union(boxes)


def prototype_names(count: int) -> list[str]:
    """leaf_00, leaf_01, ...: as wide as the greatest number needs, at least two digits."""
    width = max(2, len(str(count - 1)))
    return [f"leaf_{k:0{width}d}" for k in range(count)]


def instances_box(position: ArrayLike, turn: ArrayLike, size: ArrayLike, box: NDArray[np.float32]) -> Box:
    """The box (2, 3) around instances' boxes, as UsdGeom computes it: each turned, then boxed again.

    position (L, 3), turn (L, 4) i j k real, size (L,), box (L, 2, 3) of each instance's prototype.
    A turned box reaches as far along an axis as |R| times its half extents.
    """
    rotation = rotation_matrix(np.asarray(turn, float)) * np.asarray(size, float)[:, None, None]
    box = box.astype(float)
    middle = np.einsum("lij,lj->li", rotation, box.mean(axis=1)) + np.asarray(position, np.float32)
    half = np.einsum("lij,lj->li", np.abs(rotation), np.ptp(box, axis=1) / 2)
    return np.stack([(middle - half).min(axis=0), (middle + half).max(axis=0)]).astype(np.float32)


def place(prim: Usd.Prim, matrix: NDArray[np.float64]) -> None:
    """Give a prim its local transform: a matrix (4, 4) for column vectors."""
    UsdGeom.Xformable(prim).AddTransformOp().Set(Gf.Matrix4d(matrix.T.tolist()))
