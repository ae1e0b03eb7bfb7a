"""Faults to plant in a written tree, each with what is to be told about it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt


class Tree:
    """A written tree that is to be spoilt, layer by layer."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.stage = Usd.Stage.Open(str(path))
        self.edited: dict[str, Usd.Stage] = {}

    def prim(self, name: str) -> Usd.Prim:
        """The first prim of a name, on a stage of the one layer that defines it, for edits."""
        found = next(prim for prim in self.stage.Traverse() if prim.GetName() == name)
        layer = next(spec.layer for spec in found.GetPrimStack() if spec.specifier == Sdf.SpecifierDef)
        if layer.identifier not in self.edited:
            self.edited[layer.identifier] = Usd.Stage.Open(layer, Usd.Stage.LoadNone)
        return self.edited[layer.identifier].GetPrimAtPath(found.GetPath())

    def save(self) -> None:
        for stage in self.edited.values():
            stage.GetRootLayer().Save()

    def change(self, name: str, attribute: str, row: int | list[int], value: object) -> None:
        """Put `value` into a row, or some rows, of an array."""
        attr = self.prim(name).GetAttribute(attribute)
        array = np.array(attr.Get())
        array[row] = value
        attr.Set(type(attr.Get()).FromNumpy(array))

    def shorten(self, name: str, attribute: str) -> None:
        """Take the last value from an array."""
        attr = self.prim(name).GetAttribute(attribute)
        attr.Set(type(attr.Get()).FromNumpy(np.array(attr.Get())[:-1]))


def repeated_corner(tree: Tree) -> None:
    attr = tree.prim("branches").GetAttribute("faceVertexIndices")
    index = np.array(attr.Get())
    index[1] = index[0]
    attr.Set(Vt.IntArray.FromNumpy(index))


def flat_face(tree: Tree) -> None:
    mesh = UsdGeom.Mesh(tree.prim("branches"))
    index = np.array(mesh.GetFaceVertexIndicesAttr().Get())
    mesh.GetFaceVertexCountsAttr().Set([3] * (len(index) // 3) + [3])
    points = np.array(mesh.GetPointsAttr().Get())
    line = np.array([points[0], points[0] * 0.5 + points[1] * 0.5, points[1]], np.float32)
    n = len(points)
    mesh.GetFaceVertexIndicesAttr().Set(Vt.IntArray.FromNumpy(np.append(index, [n, n + 1, n + 2]).astype(np.int32)))
    mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(np.concatenate([points, line])))
    normals = np.array(mesh.GetNormalsAttr().Get())
    mesh.GetNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(np.concatenate([normals, normals[:3]])))
    for primvar in UsdGeom.PrimvarsAPI(mesh).GetPrimvarsWithAuthoredValues():
        if primvar.IsIndexed():
            rows = np.array(primvar.GetIndices())
            primvar.SetIndices(Vt.IntArray.FromNumpy(np.append(rows, rows[:3]).astype(np.int32)))
        elif primvar.GetInterpolation() == "vertex":
            rows = np.array(primvar.Get())
            primvar.Set(type(primvar.Get()).FromNumpy(np.concatenate([rows, rows[:3]])))


def wide_extent(tree: Tree) -> None:
    tree.change("branches", "extent", 1, [9, 9, 9])


def small_leaf_extent(tree: Tree) -> None:
    tree.change("leaves", "extent", 1, [0, 0, 0])


def short_hint(tree: Tree) -> None:
    tree.change("oak", "extentsHint", 1, [0, 0, 0])


def wide_hint(tree: Tree) -> None:
    tree.change("oak", "extentsHint", 1, [50, 50, 50])


def no_texture(tree: Tree) -> None:
    (tree.path.parent / "textures" / "bark.png").unlink()


def bark_from(path: str) -> Callable[[Tree], None]:
    def plant(tree: Tree) -> None:
        file = tree.prim("bark").GetChild("texture").GetAttribute("inputs:file")
        outside = tree.path.parent.parent / "elsewhere.png"
        shutil.copy(tree.path.parent / "textures" / "bark.png", outside)
        file.Set(Sdf.AssetPath(path.format(outside=outside)))

    return plant


def bind_to(target: str) -> Callable[[Tree], None]:
    def plant(tree: Tree) -> None:
        tree.prim("branches").GetRelationship("material:binding").SetTargets([Sdf.Path(target)])

    return plant


def broken_connection(tree: Tree) -> None:
    surface = tree.prim("bark").GetChild("surface")
    attribute = UsdShade.Shader(surface).GetInput("diffuseColor").GetAttr()
    attribute.SetConnections([surface.GetPath().GetParentPath().AppendPath("texture.outputs:nothing")])


def lost_prototype(tree: Tree) -> None:
    rel = UsdGeom.PointInstancer(tree.prim("leaves")).GetPrototypesRel()
    rel.SetTargets([*rel.GetTargets()[:-1], Sdf.Path("/oak/nowhere")])


def hidden_stranger(tree: Tree) -> None:
    UsdGeom.PointInstancer(tree.prim("leaves")).CreateInvisibleIdsAttr([3, 50])


def flattened(tree: Tree) -> None:
    UsdGeom.Xformable(tree.prim("branches")).AddScaleOp().Set(Gf.Vec3f(1, 0, 1))


def transform_of_nan(tree: Tree) -> None:
    UsdGeom.Xformable(tree.prim("oak")).AddTranslateOp().Set(Gf.Vec3d(0, float("nan"), 0))


def mirrored(tree: Tree) -> None:
    UsdGeom.Xformable(tree.prim("branches")).AddScaleOp().Set(Gf.Vec3f(1, 1, -1))


def short_sample(tree: Tree) -> None:
    attr = tree.prim("leaves").GetAttribute("positions")
    places = np.array(attr.Get())
    attr.Set(Vt.Vec3fArray.FromNumpy(places), 1.0)
    attr.Set(Vt.Vec3fArray.FromNumpy(places[:-1]), 2.0)


def uneven_primvar(tree: Tree) -> None:
    """Samples of a primvar that suit the topology at no time but are not equally long."""
    branches = tree.prim("branches")
    points = np.array(branches.GetAttribute("points").Get())
    branches.GetAttribute("points").Set(Vt.Vec3fArray.FromNumpy(points), 1.0)
    extra = UsdGeom.PrimvarsAPI(branches).CreatePrimvar("sway", Sdf.ValueTypeNames.FloatArray, "constant")
    extra.Set([1.0], 1.0)
    extra.Set([1.0, 2.0], 2.0)


def gone_subset(tree: Tree) -> None:
    mesh = UsdGeom.Mesh(tree.prim("branches"))
    UsdGeom.Subset.CreateGeomSubset(mesh, "moss", "face", Vt.IntArray([0, 12]))


def curve(points: list[tuple[float, float, float]], counts: list[int]) -> Callable[[Tree], None]:
    def plant(tree: Tree) -> None:
        home = tree.prim("branches").GetParent()
        twig = UsdGeom.BasisCurves.Define(home.GetStage(), home.GetPath().AppendChild("twig"))
        twig.CreateTypeAttr("linear")
        twig.CreatePointsAttr(points)
        twig.CreateCurveVertexCountsAttr(counts)

    return plant


def lost_index(tree: Tree) -> None:
    branches = tree.prim("branches")
    colour = UsdGeom.PrimvarsAPI(branches).CreatePrimvar("tint", Sdf.ValueTypeNames.FloatArray, "uniform")
    colour.Set([0.5, 1.0])
    colour.SetIndices(Vt.IntArray([0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 2]))


def too_few_values(tree: Tree) -> None:
    phase = UsdGeom.PrimvarsAPI(tree.prim("leaves")).CreatePrimvar("phase", Sdf.ValueTypeNames.FloatArray, "vertex")
    phase.Set([0.5] * 49)


def missing_payload(tree: Tree) -> None:
    del tree.stage  # else it would be remembered
    (tree.path.parent / "geometry.usdc").unlink()


def absolute_layer(tree: Tree) -> None:
    tree.prim("oak").GetPayloads().SetPayloads([Sdf.Payload(str(tree.path.parent / "payload.usdc"))])


# what is planted: (how, check, end of the place, part of the message, whether USD's validators alone see it)
FAULTS: dict[str, tuple[Callable[[Tree], None], str, str, str, bool]] = {
    "index": (lambda t: t.change("branches", "faceVertexIndices", 3, 8), "FaceIndexRange",
              "branches.faceVertexIndices", "1 of 36 indices lead nowhere, such as 8 into 8 points", False),
    "negative index": (lambda t: t.change("branches", "faceVertexIndices", 3, -1), "FaceIndexRange",
                       "branches.faceVertexIndices", "such as -1 into 8 points", False),
    "counts": (lambda t: t.change("branches", "faceVertexCounts", 0, 4), "FaceCounts",
               "branches.faceVertexCounts", "the counts add up to 37, but there are 36 indices", False),
    "two corners": (lambda t: t.change("branches", "faceVertexCounts", [0, 1], [2, 4]), "FaceCounts",
                    "branches.faceVertexCounts", "1 of 12 faces have fewer than 3 corners", False),
    "repeated corner": (repeated_corner, "DegenerateFace", "branches.faceVertexIndices", "such as face 0", False),
    "flat face": (flat_face, "DegenerateFace", "branches.faceVertexIndices", "1 of 13 faces", False),
    "subset": (gone_subset, "SubsetIndexRange", "branches/moss.indices", "such as 12 into 12 faces", False),
    "nan point": (lambda t: t.change("branches", "points", 2, np.nan), "NotFinite", "branches.points",
                  "1 of 8 values are NaN", False),
    "nan normal": (lambda t: t.change("branches", "normals", 2, np.nan), "NotFinite", "branches.normals",
                   "1 of 8 values are NaN", False),
    "nan uv": (lambda t: t.change("branches", "primvars:st", 0, np.inf), "NotFinite", "branches.primvars:st",
               "NaN or infinite", False),
    "nan scale": (lambda t: t.change("leaves", "scales", 4, np.nan), "NotFinite", "leaves.scales", "1 of 50", False),
    "nan transform": (transform_of_nan, "NotFinite", "/oak.xformOp:translate", "the value is NaN", False),
    "proto index": (lambda t: t.change("leaves", "protoIndices", 7, 3), "ProtoIndexRange", "leaves.protoIndices",
                    "1 of 50 indices lead nowhere, such as 3 into 3 prototypes", False),
    "no prototype": (lost_prototype, "NoPrototype", "leaves.prototypes", "there is no prim /oak/nowhere", False),
    "lengths": (lambda t: t.shorten("leaves", "scales"), "InstanceLengths", "leaves.scales",
                "has 49 values for 50 protoIndices", False),
    "quaternion": (lambda t: t.change("leaves", "orientations", 1, [0, 0, 0, 0.9]), "NotUnitQuaternion",
                   "leaves.orientations", "1 of 50 quaternions are not unit, off by up to 0.1", False),
    "zero scale": (lambda t: t.change("leaves", "scales", 0, 0), "ZeroScale", "leaves.scales", "1 of 50", False),
    "negative scale": (lambda t: t.change("leaves", "scales", 0, -0.05), "NegativeScale", "leaves.scales",
                       "1 of 50", False),
    "flattened": (flattened, "ZeroScale", "branches.xformOpOrder", "flattens", False),
    "mirrored": (mirrored, "NegativeScale", "branches.xformOpOrder", "mirrors", False),
    "hidden": (hidden_stranger, "InvisibleIds", "leaves.invisibleIds", "such as 50", False),
    "extent": (wide_extent, "Extent", "branches.extent", "wider than what is drawn", False),
    "instancer's extent": (small_leaf_extent, "Extent", "leaves.extent", "beyond the box", False),
    "short hint": (short_hint, "ExtentsHint", "/oak.extentsHint", "purpose default: what is drawn reaches", False),
    "wide hint": (wide_hint, "ExtentsHint", "/oak.extentsHint", "wider than what is drawn", False),
    "primvar": (lambda t: t.shorten("branches", "normals"), "PrimvarLength", "branches.normals",
                "has 7 values, but vertex interpolation asks for 8", False),
    "short primvar": (too_few_values, "PrimvarLength", "leaves.primvars:phase",
                      "has 49 values, but vertex interpolation asks for 50", False),
    "primvar index": (lost_index, "PrimvarIndexRange", "branches.primvars:tint:indices",
                      "such as 2 into 2 values", False),
    "sample": (short_sample, "InstanceLengths", "leaves.positions", "49 values for 50 protoIndices at time 2", False),
    "uneven": (uneven_primvar, "SampleLengths", "branches.primvars:sway", "1 to 2 values", False),
    "curve": (curve([(0, 0, 0), (0, 1, 0), (0, 2, 0)], [2]), "CurveCounts", "twig.curveVertexCounts",
              "add up to 2, but there are 3 points", False),
    "texture": (no_texture, "AssetMissing", "bark/texture.inputs:file", "bark.png is not there", True),
    "absolute texture": (bark_from("{outside}"), "AssetAbsolute", "bark/texture.inputs:file",
                         "elsewhere.png is no relative path", False),
    "outside texture": (bark_from("../elsewhere.png"), "AssetOutside", "bark/texture.inputs:file",
                        "lies outside the asset's folder", False),
    "no material": (bind_to("/oak/mtl/nothing"), "BindingTarget", "branches.material:binding",
                    "there is no material /oak/mtl/nothing", True),
    "no such kind": (bind_to("/oak/mtl/bark/surface"), "BindingTarget", "branches.material:binding",
                     "it is no material: /oak/mtl/bark/surface", True),
    "connection": (broken_connection, "ConnectionTarget", "bark/surface.inputs:diffuseColor",
                   "outputs:nothing, which is not there", False),
    "payload": (missing_payload, "CompositionError", "/", "Could not load sublayer @./geometry.usdc@", True),
    "layer": (absolute_layer, "AssetAbsolute", "oak.usda", "is no relative path", False),
}  # fmt: skip
