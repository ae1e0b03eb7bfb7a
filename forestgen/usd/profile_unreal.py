"""Profile unreal: the variant set LOD on a tree's root, each variant with one mesh of its own name.

    <name>.usda         /<name> Xform, kind component; variants LOD0 ... with payloads LOD0.usdc ...
    LOD0.usdc ...       /<name>/LOD0 Mesh: wood and leaves in one, a GeomSubset for each material, wind data a point
    materials.usdc      /<name>/mtl
    textures/           the pictures

Unreal's importer makes one static mesh with levels of detail of a prim whose variant set is called LOD, where
each variant LODk holds, as a direct child of that prim, one Mesh that is called LODk too
(UsdUtils::IterateLODMeshes of its USDUtilities; GetLODMesh of its Interchange translator). It turns metres and
Y up into its own centimetres and Z up by the stage's metadata.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade, Vt

from forestgen.tree.joined import joined
from forestgen.tree.model import Mesh
from forestgen.usd.component import define_component, take_materials
from forestgen.usd.composed import Composed, Part
from forestgen.usd.flat_wind import author_flat_wind
from forestgen.usd.geometry import Box, bind, define_mesh, union, vec3f
from forestgen.usd.layers import new_stage, save
from forestgen.usd.variants import LOD_SET, level_name


def write_unreal(tree: Path, folder: Path, variants: Mapping[str, str]) -> Path:
    """Write the tree of a root layer into `folder`, all its levels; give its path.

    Raises:
        InputError: a layer or a picture is missing.
        OSError: a file could not be written.
    """
    composed = Composed(tree)
    composed.select_known(variants)
    path, names = composed.root.GetPath(), [level_name(k) for k in range(composed.n_levels())]
    boxes: list[Box] = []
    materials: set[Sdf.Path] = set()
    layers: dict[str, Sdf.Layer] = {}
    for k, name in enumerate(names):
        composed.select_level(k)
        parts = composed.parts(composed.drawables())
        materials |= {part.material for part in parts}
        level = new_stage(composed.name)
        UsdGeom.Xform.Define(level, path)
        mesh = joined([part.mesh for part in parts])
        boxes.append(_define(level, path.AppendChild(name), mesh, parts, path.AppendChild("mtl")))
        geo = composed.stage.GetPrimAtPath(path.AppendChild("geo"))
        author_flat_wind(level.GetPrimAtPath(path.AppendChild(name)), mesh, parts, geo)
        layers[name] = level.GetRootLayer()
    layers["materials"] = new_stage(composed.name).GetRootLayer()
    Sdf.CreatePrimInLayer(layers["materials"], path).typeName = "Xform"
    pictures = take_materials(composed, materials, layers["materials"], path.AppendChild("mtl"), "textures")

    (folder / "textures").mkdir(parents=True, exist_ok=True)
    for name, picture in pictures.items():
        shutil.copyfile(picture, folder / name)
    for name, layer in layers.items():
        save(layer, folder / f"{name}.usdc")
    return save(_root(composed, names, union(boxes), tree.name), folder / tree.name)


def _define(stage: Usd.Stage, path: Sdf.Path, mesh: Mesh, parts: Sequence[Part], mtl: Sdf.Path) -> Box:
    """Author parts, joined as one mesh, faces in their order, a subset for each where there are several."""
    box = define_mesh(stage, path, mesh, mtl.AppendChild(parts[0].material.name))
    if len(parts) == 1:
        return box
    UsdGeom.Subset.SetFamilyType(
        UsdGeom.Mesh(stage.GetPrimAtPath(path)), UsdShade.Tokens.materialBind, UsdGeom.Tokens.partition
    )
    first = 0
    for part in parts:
        subset = UsdGeom.Subset.Define(stage, path.AppendChild(part.material.name))
        subset.CreateElementTypeAttr(UsdGeom.Tokens.face)
        subset.CreateFamilyNameAttr(UsdShade.Tokens.materialBind)
        index = np.arange(first, first + len(part.mesh.faces), dtype=np.int32)
        subset.CreateIndicesAttr(Vt.IntArray.FromNumpy(index))
        bind(subset.GetPrim(), mtl.AppendChild(part.material.name))
        first += len(index)
    return box


def _root(composed: Composed, names: Sequence[str], box: Box, file: str) -> Sdf.Layer:
    """The root layer; no stage looks at its variants' payloads: they are not there yet."""
    stage = new_stage(composed.name)
    prim = define_component(stage, composed.root.GetPath(), composed.root, file)
    UsdGeom.ModelAPI.Apply(prim).SetExtentsHint(vec3f(box))
    prim.GetPayloads().AddPayload("./materials.usdc")
    choice = prim.GetVariantSets().AddVariantSet(LOD_SET)
    for name in (*names[1:], names[0]):  # the last to be selected stays so
        choice.AddVariant(name)
        choice.SetVariantSelection(name)
        with choice.GetVariantEditContext():
            prim.GetPayloads().AddPayload(f"./{name}.usdc")
    return stage.GetRootLayer()
