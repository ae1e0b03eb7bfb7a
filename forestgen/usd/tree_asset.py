"""One tree as a USD component: a root layer, and behind its payload geometry, materials, textures.

    <name>.usda       /<name> Xform, kind component, extents hint, payload, variant sets, class to inherit from
    payload.usdc      sublayers those below
    geometry.usdc     /<name>/geo/LOD0/branches Mesh, /<name>/geo/LOD0/leaves PointInstancer
    lods.usdc         /<name>/geo/LOD1 ...: coarser levels of detail, the last one of cards; sizes to switch at
    wind.usdc         primvars:wind:* on geo and every mesh and instancer below it
    guides.usdc       /<name>/guides: the skeleton as curves, capsules to collide with
    materials.usdc    /<name>/mtl/bark, leaf, leaf_cards
    textures/         leaf.png (colour and cut-out), bark.png, leaf_cards.png
    skeleton.json     the skeleton as data

The structure is the one of the usd-wg asset guidelines.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from forestgen.tree.extras import Extras
from forestgen.tree.level import Level, full_level
from forestgen.tree.model import TreeModel
from forestgen.tree.skeleton_json import skeleton_json
from forestgen.usd.geometry import Box, define_leaves, define_mesh, union, vec3f
from forestgen.usd.guides import guides_layer
from forestgen.usd.layers import new_stage, require_prim_name, save
from forestgen.usd.materials import define_leaf_material, define_plain_material, define_textured_material
from forestgen.usd.variants import define_lod_sizes, define_lod_variants, level_name
from forestgen.usd.wind import wind_layer

CARDS = "leaf_cards"  # prim, material and texture
SKELETON = "skeleton.json"


def write_tree_asset(model: TreeModel, folder: Path, extras: Extras | None = None) -> Path:
    """Write a tree under `folder`, whose name becomes the prim's; give the path of its root layer.

    A bare tree has no instancer and no leaf material. The bytes depend on the model and extras alone.

    Raises:
        ValueError: the folder's name is no prim name, or the model cannot be drawn; no layer is written.
        OSError: a file could not be written.
    """
    name = folder.name
    require_prim_name(name)
    extras = Extras() if extras is None else extras
    geometry, box = _levels(name, [full_level(model)])
    layers = {"geometry": geometry, "materials": _materials(model, extras, name)}
    if extras.levels:
        layers["lods"], coarser = _levels(name, extras.levels, first=1)
        box = union([box, coarser])  # whichever level is chosen, nothing is beyond the extents hint
        sizes = [level.switch_px for level in extras.levels]
        define_lod_sizes(Usd.Stage.Open(layers["lods"]), Sdf.Path(f"/{name}"), sizes, box)
    if extras.wind:
        layers["wind"] = wind_layer(name, model.skeleton, [full_level(model), *extras.levels])
    if extras.guides:
        layers["guides"] = guides_layer(name, model.skeleton)
    below = sorted(layers, reverse=True)  # wind is the strongest: it adds to prims that others define
    layers["payload"] = _payload(name, [f"./{layer}.usdc" for layer in below])
    root = _root(model, name, box, 1 + len(extras.levels))

    (folder / "textures").mkdir(parents=True, exist_ok=True)
    for texture, image in _textures(model, extras).items():
        write_png(image, folder / "textures" / f"{texture}.png")
    if extras.guides:
        (folder / SKELETON).write_text(json.dumps(skeleton_json(model.skeleton), separators=(",", ":")), "utf-8")
    for layer, content in layers.items():
        save(content, folder / f"{layer}.usdc")
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


def _textures(model: TreeModel, extras: Extras) -> dict[str, NDArray[np.uint8]]:
    """Pictures by name."""
    textures = {}
    if len(model.leaves):
        textures["leaf"] = model.atlas.rgba
    if not _is_plain(model.bark.rgb):
        textures["bark"] = model.bark.rgb
    if extras.has_cards:
        textures[CARDS] = extras.card_atlas
    return textures


def _levels(name: str, levels: Sequence[Level], first: int = 0) -> tuple[Sdf.Layer, Box]:
    """The layer of some levels of detail, numbered from `first`, and the box (2, 3) around them."""
    stage = new_stage(name)
    tree = UsdGeom.Xform.Define(stage, f"/{name}").GetPath()
    geo = UsdGeom.Scope.Define(stage, tree.AppendChild("geo")).GetPath()
    mtl = tree.AppendChild("mtl")
    boxes = []
    for k, level in enumerate(levels, start=first):
        home = UsdGeom.Xform.Define(stage, geo.AppendChild(level_name(k))).GetPath()
        if len(level.mesh.faces) or not k:  # a full tree without wood is an error
            boxes.append(define_mesh(stage, home.AppendChild("branches"), level.mesh, mtl.AppendChild("bark")))
        if len(level.leaves):
            leaves = home.AppendChild("leaves")
            boxes.append(define_leaves(stage, leaves, level.leaves, level.prototypes, mtl.AppendChild("leaf")))
        if len(level.cards.faces):
            boxes.append(define_mesh(stage, home.AppendChild(CARDS), level.cards, mtl.AppendChild(CARDS)))
    return stage.GetRootLayer(), union(boxes)


def _materials(model: TreeModel, extras: Extras, name: str) -> Sdf.Layer:
    stage = new_stage(name)
    tree = UsdGeom.Xform.Define(stage, f"/{name}").GetPath()
    mtl = UsdGeom.Scope.Define(stage, tree.AppendChild("mtl")).GetPath()
    if _is_plain(model.bark.rgb):
        define_plain_material(stage, mtl.AppendChild("bark"), model.bark.rgb[0, 0] / 255)
    else:
        define_textured_material(stage, mtl.AppendChild("bark"), "./textures/bark.png")
    if len(model.leaves):
        define_leaf_material(stage, mtl.AppendChild("leaf"), "./textures/leaf.png")
    if extras.has_cards:
        define_leaf_material(stage, mtl.AppendChild(CARDS), f"./textures/{CARDS}.png")
    return stage.GetRootLayer()


def _payload(name: str, layers: Sequence[str]) -> Sdf.Layer:
    layer = new_stage(name).GetRootLayer()
    Sdf.CreatePrimInLayer(layer, f"/{name}").specifier = Sdf.SpecifierOver
    layer.subLayerPaths = list(layers)
    return layer


def _root(model: TreeModel, name: str, box: Box, n_levels: int) -> Sdf.Layer:
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
    if n_levels > 1:
        define_lod_variants(prim, n_levels)
    return stage.GetRootLayer()
