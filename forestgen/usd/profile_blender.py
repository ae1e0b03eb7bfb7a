"""Profile blender: one level of a tree with its variants chosen, in one layer; leaves stay instances.

    <name>.usda     /<name> Xform, kind component, extents hint, payload
    payload.usdc    all below it, flattened; materials with nothing but their UsdPreviewSurface
    textures/       the pictures that those need

Blender 4.5 imports instancers with plain meshes, and variants only as they are selected.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

from pxr import Sdf, Usd, UsdGeom

from forestgen.usd.component import define_component
from forestgen.usd.composed import Composed
from forestgen.usd.layers import new_stage, save
from forestgen.usd.take_materials import keep_surface, move_pictures
from forestgen.usd.variants import SIZES

HINT = "extentsHint"


def write_blender(tree: Path, folder: Path, variants: Mapping[str, str], level: int) -> Path:
    """Write the tree of a root layer into `folder`; `level` beyond its last means the last.

    Raises:
        InputError: a layer or a picture is missing.
        OSError: a file could not be written.
    """
    composed = Composed(tree)
    composed.select_known(variants)
    composed.select_level(min(level, composed.n_levels() - 1))
    layer, path = composed.flat_layer(), composed.root.GetPath()
    stage = new_stage(composed.name)
    root = define_component(stage, path, composed.root, tree.name)
    if composed.stage.HasAuthoredTimeCodeRange():
        stage.SetStartTimeCode(composed.stage.GetStartTimeCode())
        stage.SetEndTimeCode(composed.stage.GetEndTimeCode())
        stage.SetTimeCodesPerSecond(composed.stage.GetTimeCodesPerSecond())
        stage.SetFramesPerSecond(composed.stage.GetFramesPerSecond())
    hint = UsdGeom.ModelAPI.Apply(root)
    if composed.root.GetAttribute(HINT).GetNumTimeSamples():
        Sdf.CopySpec(layer, path.AppendProperty(HINT), stage.GetRootLayer(), path.AppendProperty(HINT))
    else:  # that of the source is wide enough for all levels
        boxes = UsdGeom.BBoxCache(Usd.TimeCode.Default(), UsdGeom.Imageable.GetOrderedPurposeTokens())
        hint.SetExtentsHint(UsdGeom.ModelAPI(composed.root).ComputeExtentsHint(boxes))
    stage.GetRootLayer().GetPrimAtPath(path).payloadList.Prepend(Sdf.Payload("./payload.usdc"))

    _strip(layer, path)
    pictures = move_pictures(layer, path, "textures")
    (folder / "textures").mkdir(parents=True, exist_ok=True)
    for name, picture in pictures.items():
        shutil.copyfile(picture, folder / name)
    save(layer, folder / "payload.usdc")
    return save(stage.GetRootLayer(), folder / tree.name)


def _strip(layer: Sdf.Layer, path: Sdf.Path) -> None:
    """Leave in a flattened tree what its root layer does not say, and what the selected variants use."""
    for prim in list(layer.rootPrims):
        if prim.path != path:
            del layer.rootPrims[prim.name]
    root = layer.GetPrimAtPath(path)
    for key in ("assetInfo", "customData", "displayName", "kind", "apiSchemas"):
        root.ClearInfo(key)
    for name in list(root.properties.keys()):
        root.RemoveProperty(root.properties[name])
    if SIZES in root.nameChildren:
        del root.nameChildren[SIZES]
    bound: set[Sdf.Path] = set()
    materials: list[Sdf.PrimSpec] = []

    def visit(at: Sdf.Path) -> None:
        if at.IsPrimPath() and layer.GetPrimAtPath(at).typeName == "Material":
            materials.append(layer.GetPrimAtPath(at))
        elif at.IsPropertyPath() and at.name.startswith("material:binding"):
            bound.update(layer.GetRelationshipAtPath(at).targetPathList.GetAddedOrExplicitItems())

    layer.Traverse(path, visit)
    for material in materials:
        if material.path in bound:
            keep_surface(material)
        else:
            del material.nameParent.nameChildren[material.name]
