"""A component made over: its root prim, which says what the tree's own root says, and its materials."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pxr import Sdf, Usd, UsdGeom

from forestgen.usd.composed import Composed
from forestgen.usd.take_materials import flat_materials, move_pictures, take_material


def define_component(stage: Usd.Stage, path: Sdf.Path, source: Usd.Prim, file: str) -> Usd.Prim:
    """Define a component that says of itself what `source` says, but has neither arcs nor variants.

    `file` is the name of the file that it will be found in.
    """
    prim = UsdGeom.Xform.Define(stage, path).GetPrim()
    model, known = Usd.ModelAPI(prim), Usd.ModelAPI(source)
    model.SetKind("component")
    if known.GetAssetName():
        model.SetAssetName(known.GetAssetName())
        model.SetAssetIdentifier(Sdf.AssetPath(f"./{file}"))
        model.SetAssetVersion(known.GetAssetVersion())
    if source.HasAuthoredDisplayName():
        prim.SetDisplayName(source.GetDisplayName())
    notes = source.GetCustomDataByKey("forestgen")
    if notes:
        prim.SetCustomDataByKey("forestgen", notes)
    return prim


def take_materials(
    composed: Composed, materials: Iterable[Sdf.Path], layer: Sdf.Layer, home: Sdf.Path, folder: str
) -> dict[str, Path]:
    """Copy materials of a stage below `home` of a layer, strictly; give the pictures they need.

    The pictures are told by their names in `folder`, as the layer now says them.

    Raises:
        InputError: a picture is missing.
    """
    wanted = sorted(set(materials))
    source = flat_materials(composed.stage, wanted)
    for material in wanted:
        take_material(source, material, layer, home.AppendChild(material.name), is_strict=True)
    layer.GetPrimAtPath(home).specifier = Sdf.SpecifierDef
    layer.GetPrimAtPath(home).typeName = "Scope"
    return move_pictures(layer, home, folder)
