"""Checks of meshes, curves and subsets: counts, indices, areas, and primvars that fit them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from forestgen.usd.finding import Finding, own_finding
from forestgen.usd.own_checks_values import Array, Values, at

FLAT = 1e-7  # a face whose area is below this share of its longest edge squared is a line: float32's last digit


def mesh(values: Values) -> Iterator[Finding]:
    """Faces: three corners or more, as many indices as corners, indices that lead to points."""
    counts, index = values.array("faceVertexCounts"), values.array("faceVertexIndices")
    n_points = values.count("points", 3)
    if counts is None or index is None:
        return
    if len(counts) and counts.min() < 3:
        message = f"{int((counts < 3).sum())} of {len(counts)} faces have fewer than 3 corners{at(values)}"
        yield own_finding("FaceCounts", values.path.AppendProperty("faceVertexCounts"), message)
    if counts.sum() != len(index):
        message = f"the counts add up to {counts.sum()}, but there are {len(index)} indices{at(values)}"
        yield own_finding("FaceCounts", values.path.AppendProperty("faceVertexCounts"), message)
    yield from in_range(values, "faceVertexIndices", index, n_points, "points", "FaceIndexRange")
    for name, bound, what in (("holeIndices", len(counts), "faces"), ("cornerIndices", n_points, "points"),
                              ("creaseIndices", n_points, "points")):  # fmt: skip
        yield from in_range(values, name, values.array(name), bound, what, "FaceIndexRange")


def in_range(
    values: Values, name: str, index: Array | None, bound: int, what: str, error: str, at_least: int = 0
) -> Iterator[Finding]:
    """Every index is at least `at_least` and below `bound`, the number of `what`."""
    if index is None or not len(index) or at_least <= index.min() <= index.max() < bound:
        return
    n = int(((index < at_least) | (index >= bound)).sum())
    worst = index.max() if index.max() >= bound else index.min()
    message = f"{n} of {len(index)} indices lead nowhere, such as {worst} into {bound} {what}{at(values)}"
    yield own_finding(error, values.path.AppendProperty(name), message)


def areas(values: Values) -> Iterator[Finding]:
    """No face repeats a corner or has no area; asked only of meshes that stand still: what grows starts at nothing."""
    counts, index, points = (values.array(name, width) for name, width in
                             (("faceVertexCounts", 0), ("faceVertexIndices", 0), ("points", 3)))  # fmt: skip
    if counts is None or index is None or points is None or values.varies("points"):
        return
    if not len(counts) or counts.min() < 3 or counts.sum() != len(index):
        return  # told by `mesh`
    if not 0 <= index.min() <= index.max() < len(points) or not np.isfinite(points).all():
        return
    repeated, flat = degenerate(counts.astype(np.int64), index.astype(np.int64), points)
    if n := int((repeated | flat).sum()):
        first = int(np.argmax(repeated | flat))
        message = f"{n} of {len(counts)} faces have no area or repeat a corner, such as face {first}"
        yield own_finding("DegenerateFace", values.path.AppendProperty("faceVertexIndices"), message)


def degenerate(
    counts: NDArray[np.int64], index: NDArray[np.int64], points: Array
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which faces (F,) have the same corner twice in a row, and which have no area.

    A face's area is half the length of the sum of its fan's cross products (Newell).
    """
    if (counts == counts[0]).all():
        corner = index.reshape(len(counts), counts[0])
        repeated = (corner == np.roll(corner, -1, axis=1)).any(axis=1)
        place = points[corner].astype(np.float64)
        spoke = place[:, 1:] - place[:, :1]
        normal = np.cross(spoke[:, :-1], spoke[:, 1:]).sum(axis=1)
        longest = np.maximum((spoke**2).sum(axis=2).max(axis=1), ((place[:, 1] - place[:, -1]) ** 2).sum(axis=1))
    else:
        start = np.cumsum(counts) - counts
        following = np.arange(1, len(index) + 1)
        following[start + counts - 1] = start
        repeated = np.logical_or.reduceat(index == index[following], start)
        spoke = (points[index] - points[np.repeat(index[start], counts)]).astype(np.float64)
        normal = np.add.reduceat(np.cross(spoke, spoke[following]), start)
        longest = np.maximum.reduceat((spoke**2).sum(axis=1), start)
    return repeated, np.linalg.norm(normal, axis=1) / 2 <= FLAT * longest


def curves(values: Values) -> Iterator[Finding]:
    """Curves: two points or more each, as many points as the counts say."""
    counts = values.array("curveVertexCounts")
    if counts is None:
        return
    if len(counts) and counts.min() < 2:
        message = f"{int((counts < 2).sum())} of {len(counts)} curves have fewer than 2 points{at(values)}"
        yield own_finding("CurveCounts", values.path.AppendProperty("curveVertexCounts"), message)
    if counts.sum() != values.count("points", 3):
        message = f"the counts add up to {counts.sum()}, but there are {values.count('points', 3)} points{at(values)}"
        yield own_finding("CurveCounts", values.path.AppendProperty("curveVertexCounts"), message)


def subset(values: Values) -> Iterator[Finding]:
    """A subset's indices lead to faces or points of its mesh; asked of subsets without family: USD checks families."""
    parent = Values(values.prim.GetParent())
    kind = UsdGeom.Subset(values.prim).GetElementTypeAttr().Get()
    known = {"face": ("faceVertexCounts", "faces"), "point": ("points", "points")}
    family = UsdGeom.Subset(values.prim).GetFamilyNameAttr().Get()
    if family or not values.prim.GetParent().IsA(UsdGeom.Mesh) or kind not in known:
        return
    name, what = known[kind]
    bound = max(parent.count(name) for _ in parent.times())
    yield from in_range(values, "indices", values.array("indices"), bound, what, "SubsetIndexRange")


def sizes(values: Values) -> dict[str, int] | None:
    """How many values each interpolation asks for; None for prims of which it is not known."""
    prim = values.prim
    if prim.IsA(UsdGeom.Mesh):
        n, faces = values.count("points", 3), values.count("faceVertexCounts")
        corners = values.count("faceVertexIndices")
        return {"constant": 1, "uniform": faces, "varying": n, "vertex": n, "faceVarying": corners}
    if prim.IsA(UsdGeom.PointInstancer):  # as a point cloud: one value an instance
        n = values.count("protoIndices")
    elif prim.IsA(UsdGeom.Points):
        n = values.count("points", 3)
    elif prim.IsA(UsdGeom.BasisCurves):
        api, time = UsdGeom.BasisCurves(prim), values.time
        varying = api.ComputeVaryingDataSize(time)
        vertex, uniform = api.ComputeVertexDataSize(time), api.ComputeUniformDataSize(time)
        return {"constant": 1, "uniform": uniform, "varying": varying, "vertex": vertex, "faceVarying": varying}
    else:
        return None
    return {"constant": 1, "uniform": 1, "varying": n, "vertex": n, "faceVarying": n}


def primvars(values: Values) -> Iterator[Finding]:
    """Every primvar, and normals and widths, have as many values as their interpolation asks for; indices fit."""
    asked = sizes(values)
    if asked is None:
        return
    for primvar in UsdGeom.PrimvarsAPI(values.prim).GetPrimvarsWithAuthoredValues():
        name, rate = primvar.GetAttr().GetName(), str(primvar.GetInterpolation())
        if not primvar.GetTypeName().isArray:
            continue
        n = _length(values, name)
        if primvar.IsIndexed():
            index = values.array(f"{name}:indices")
            bound = n // max(primvar.GetElementSize(), 1)
            yield from in_range(values, f"{name}:indices", index, bound, "values", "PrimvarIndexRange")
            n = 0 if index is None else len(index) * primvar.GetElementSize()
        yield from _fits(values, name, n, rate, asked, primvar.GetElementSize())
    for name, rate in _schema_primvars(values):
        yield from _fits(values, name, values.count(name), rate, asked, 1)


def _length(values: Values, name: str) -> int:
    array = values.array(name)
    if array is not None:
        return len(array)
    value = values.prim.GetAttribute(name).Get(values.time)  # strings and tokens
    return len(value) if hasattr(value, "__len__") else 0


def _schema_primvars(values: Values) -> Iterator[tuple[str, str]]:
    """(name, interpolation) of the attributes that are as good as primvars, where no primvar replaces them."""
    prim = values.prim
    if prim.IsA(UsdGeom.PointInstancer):
        return
    api = UsdGeom.PointBased(prim)
    for name, rate in (("normals", api.GetNormalsInterpolation()), ("widths", _widths_rate(prim))):
        if values.count(name) and not prim.HasAttribute(f"primvars:{name}"):
            yield name, str(rate)
    for name in ("velocities", "accelerations"):
        if values.count(name):
            yield name, "vertex"


def _widths_rate(prim: Usd.Prim) -> str:
    for kind in (UsdGeom.Curves, UsdGeom.Points):
        if prim.IsA(kind):
            return str(kind(prim).GetWidthsInterpolation())
    return "constant"


def _fits(values: Values, name: str, n: int, rate: str, asked: dict[str, int], element: int) -> Iterator[Finding]:
    wanted = asked.get(rate, n) * max(element, 1)
    is_list = rate == UsdGeom.Tokens.constant and n > wanted  # arrays of one's own are often stored so
    if n != wanted and not is_list:
        message = f"has {n} values, but {rate} interpolation asks for {wanted}{at(values)}"
        yield own_finding("PrimvarLength", values.path.AppendProperty(name), message)
