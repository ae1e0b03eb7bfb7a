"""Polygons: a UsdGeomMesh of any kind becomes triangles with one uv and one normal a point."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from forestgen.errors import InputError

APART = ("faceVarying", "uniform")  # interpolations that may give a point several values


@dataclass(frozen=True, eq=False)
class Triangles:
    """A mesh's triangles in its own space. P points, F triangles."""

    points: NDArray[np.float64]  # (P, 3)
    faces: NDArray[np.int64]  # (F, 3) into points
    polygon: NDArray[np.int64]  # (F,) the mesh's face that each triangle is a part of
    normals: NDArray[np.float64] | None  # (P, 3) unit
    uv: Callable[[str], NDArray[np.float64] | None]  # name of a primvar -> (P, 2)
    stored: NDArray[np.int64]  # (P,) the mesh's own point that each is


def read_triangles(prim: Usd.Prim, time: Usd.TimeCode) -> Triangles | None:
    """Cut a mesh's polygons into fans; None where it has no face. The control cage stands for a subdivision surface.

    Points are kept as they are when all attributes are per point. Where texture coordinates alone are by corner and
    have an index, a point stands as often as it has coordinates, in their order; else each corner gets its own.

    Raises:
        InputError: an index or a count that does not fit the points.
    """
    mesh = UsdGeom.Mesh(prim)
    points = _array(mesh.GetPointsAttr().Get(time), float).reshape(-1, 3)
    count = _array(mesh.GetFaceVertexCountsAttr().Get(time), np.int64)
    index = _array(mesh.GetFaceVertexIndicesAttr().Get(time), np.int64)
    if not len(count):
        return None
    if (
        count.min() < 0
        or count.sum() != len(index)
        or (len(index) and not 0 <= index.min() <= index.max() < len(points))
    ):
        raise InputError(f"{prim.GetPath()}: faceVertexCounts and faceVertexIndices do not fit {len(points)} points")
    corner, polygon = fan(count)
    hole = _array(mesh.GetHoleIndicesAttr().Get(time), np.int64)
    keep = ~np.isin(polygon, hole)
    corner, polygon = corner[keep], polygon[keep]
    if mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded:
        corner = corner[:, ::-1]

    owner = np.repeat(np.arange(len(count)), count)  # polygon of each corner
    primvars = UsdGeom.PrimvarsAPI(prim).GetPrimvarsWithValues()
    normals, rate = _normals(mesh, time)
    cut = [v for v in primvars if _is_uv(v) and v.GetInterpolation() in APART]
    at = own = np.arange(len(index))  # a corner that each returned point stands at, and the point of each corner
    if normals is not None and rate in APART:
        stored = index
    elif cut:
        at, own = _seams(index, cut, time)
        stored = index[at]
    else:
        own, stored = index, np.arange(len(points))

    def spread(values: NDArray[np.float64], interpolation: str) -> NDArray[np.float64]:
        """Values of any interpolation, one a point as returned."""
        if interpolation == UsdGeom.Tokens.constant:
            row = np.zeros(len(stored), np.int64)
        elif interpolation == UsdGeom.Tokens.uniform:
            row = owner[at]
        elif interpolation == UsdGeom.Tokens.faceVarying:
            row = at
        else:
            row = stored
        if len(row) and row.max() >= len(values):
            raise InputError(f"{prim.GetPath()}: an attribute of {interpolation} interpolation is too short")
        return values[row]

    def uv(name: str) -> NDArray[np.float64] | None:
        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
        if not (primvar and primvar.HasValue()):
            return None
        return spread(np.array(primvar.ComputeFlattened(time), float).reshape(-1, 2), primvar.GetInterpolation())

    return Triangles(
        points=points[stored],
        faces=own[corner],
        polygon=polygon,
        normals=None if normals is None else _unit(spread(normals, rate)),
        uv=uv,
        stored=stored,
    )


def _seams(
    index: NDArray[np.int64], cut: Sequence[UsdGeom.Primvar], time: Usd.TimeCode
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Points where texture coordinates `cut` are by corner: a corner of each (Q,), and the point of each corner (C,).

    `index` (C,) is the mesh's own point at each corner. With one entry of an index of corners it stands once.
    """
    every = np.arange(len(index))
    if len(cut) > 1 or cut[0].GetInterpolation() != UsdGeom.Tokens.faceVarying or not cut[0].IsIndexed():
        return every, every
    entry = np.array(cut[0].GetIndices(time), np.int64)
    if len(entry) != len(index) or not len(entry) or entry.min() < 0:
        return every, every
    if entry.max() < len(index):
        at = np.full(entry.max() + 1, -1)
        at[entry[::-1]] = every[::-1]  # the first corner with each entry
        if at.min() >= 0 and np.array_equal(index[at[entry]], index):
            return at, entry  # each entry is of one point, as in what this program writes of wood: nothing to sort
    _, at, own = np.unique(entry * (index.max() + 1) + index, return_index=True, return_inverse=True)
    return at, own


def fan(count: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangles (F, 3) as corner numbers, in the order of their polygons, and the polygon (F,) of each.

    Polygons have `count` corners, numbered one after the other; those below three give nothing.
    """
    first = np.cumsum(count) - count
    n = np.maximum(count - 2, 0)
    polygon = np.repeat(np.arange(len(count)), n)
    step = np.arange(len(polygon)) - np.repeat(np.cumsum(n) - n, n)
    start = first[polygon]
    return np.stack([start, start + step + 1, start + step + 2], axis=1), polygon


def _array(value: object, dtype: type) -> NDArray:  # type: ignore[type-arg]
    return np.array([] if value is None else value, dtype)


def _is_uv(primvar: UsdGeom.Primvar) -> bool:
    kind = primvar.GetTypeName().type.typeName
    return "2f" in kind or "2d" in kind or "2h" in kind


def _normals(mesh: UsdGeom.Mesh, time: Usd.TimeCode) -> tuple[NDArray[np.float64] | None, str]:
    """Authored normals and their interpolation; the primvar wins over the attribute."""
    primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
    if primvar and primvar.HasValue():
        return np.array(primvar.ComputeFlattened(time), float).reshape(-1, 3), primvar.GetInterpolation()
    value = _array(mesh.GetNormalsAttr().Get(time), float).reshape(-1, 3)
    return (value if len(value) else None), mesh.GetNormalsInterpolation()


def _unit(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0, normals / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])
