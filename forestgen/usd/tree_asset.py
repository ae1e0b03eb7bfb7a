"""One tree as a USD component: a root layer, and behind its payload geometry, materials, textures.

    <name>.usda       /<name> Xform, kind component, extents hint, payload, class to inherit from
    payload.usdc      sublayers the two below
    geometry.usdc     /<name>/geo/LOD0/branches Mesh, /<name>/geo/LOD0/leaves PointInstancer
    materials.usdc    /<name>/mtl/bark, /<name>/mtl/leaf
    textures/         leaf.png (colour and cut-out), bark.png

The structure is the one of the usd-wg asset guidelines.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from forestgen.tree.model import TreeModel
from forestgen.usd.geometry import Box, define_leaves, define_mesh, union, vec3f
from forestgen.usd.layers import new_stage, require_prim_name, save
from forestgen.usd.materials import define_leaf_material, define_plain_material, define_textured_material


def write_tree_asset(model: TreeModel, folder: Path) -> Path:
    """Write a tree under `folder`, whose name becomes the prim's; give the path of its root layer.

    A bare tree has no instancer and no leaf material. The bytes depend on the model alone.

    Raises:
        ValueError: the folder's name is no prim name, or the model cannot be drawn; no layer is written.
        OSError: a file could not be written.
    """
    name = folder.name
    require_prim_name(name)
    geometry, box = _geometry(model, name)
    materials = _materials(model, name)
    payload = _payload(name)
    root = _root(model, name, box)

    (folder / "textures").mkdir(parents=True, exist_ok=True)
    if len(model.leaves):
        write_png(model.atlas.rgba, folder / "textures" / "leaf.png")
    if not _is_plain(model.bark.rgb):
        write_png(model.bark.rgb, folder / "textures" / "bark.png")
    save(geometry, folder / "geometry.usdc")
    save(materials, folder / "materials.usdc")
    save(payload, folder / "payload.usdc")
    return save(root, folder / f"{name}.usda")


def write_png(image: NDArray[np.uint8], path: Path) -> None:
    """Write an image (H, W, 3 or 4) as PNG: no time stamp, the same bytes for the same pixels.

    Raises:
        OSError: the file could not be written.
    """
    order = [2, 1, 0, 3][: image.shape[2]]
    is_encoded, data = cv2.imencode(".png", np.ascontiguousarray(image[..., order]))
    if not is_encoded:
        raise ValueError(f"{path.name}: an image of shape {image.shape} cannot be written as PNG")
    path.write_bytes(data.tobytes())


def _is_plain(rgb: NDArray[np.uint8]) -> bool:
    return rgb.shape[:2] == (1, 1)


def _geometry(model: TreeModel, name: str) -> tuple[Sdf.Layer, Box]:
    """The layer of meshes and leaves, and the box (2, 3) around them."""
    stage = new_stage(name)
    tree = UsdGeom.Xform.Define(stage, f"/{name}").GetPath()
    geo = UsdGeom.Scope.Define(stage, tree.AppendChild("geo")).GetPath()
    full = UsdGeom.Xform.Define(stage, geo.AppendChild("LOD0")).GetPath()
    mtl = tree.AppendChild("mtl")
    boxes = [define_mesh(stage, full.AppendChild("branches"), model.mesh, mtl.AppendChild("bark"))]
    if len(model.leaves):
        leaves = full.AppendChild("leaves")
        boxes.append(define_leaves(stage, leaves, model.leaves, model.atlas.prototypes, mtl.AppendChild("leaf")))
    return stage.GetRootLayer(), union(boxes)


def _materials(model: TreeModel, name: str) -> Sdf.Layer:
    stage = new_stage(name)
    tree = UsdGeom.Xform.Define(stage, f"/{name}").GetPath()
    mtl = UsdGeom.Scope.Define(stage, tree.AppendChild("mtl")).GetPath()
    if _is_plain(model.bark.rgb):
        define_plain_material(stage, mtl.AppendChild("bark"), model.bark.rgb[0, 0] / 255)
    else:
        define_textured_material(stage, mtl.AppendChild("bark"), "./textures/bark.png")
    if len(model.leaves):
        define_leaf_material(stage, mtl.AppendChild("leaf"), "./textures/leaf.png")
    return stage.GetRootLayer()


def _payload(name: str) -> Sdf.Layer:
    layer = new_stage(name).GetRootLayer()
    Sdf.CreatePrimInLayer(layer, f"/{name}").specifier = Sdf.SpecifierOver
    layer.subLayerPaths = ["./materials.usdc", "./geometry.usdc"]
    return layer


def _root(model: TreeModel, name: str, box: Box) -> Sdf.Layer:
    stage = new_stage(name)
    shared = stage.CreateClassPrim("/__class__").GetPath().AppendChild(name)
    stage.CreateClassPrim(shared)
    prim = UsdGeom.Xform.Define(stage, f"/{name}").GetPrim()
    prim.GetInherits().AddInherit(shared)
    prim.GetPayloads().AddPayload("./payload.usdc")
    hint = UsdGeom.ModelAPI.Apply(prim)
    hint.SetExtentsHint(vec3f(box))
    asset = Usd.ModelAPI(prim)
    asset.SetKind("component")
    asset.SetAssetName(name)
    asset.SetAssetIdentifier(Sdf.AssetPath(f"./{name}.usda"))
    asset.SetAssetVersion("1")
    if model.name and model.name != name:
        prim.SetDisplayName(model.name)
    prim.SetCustomData({"forestgen": {"method": model.method, "seed": model.seed, "height": float(model.height)}})
    return stage.GetRootLayer()
