"""One tree as a USD component: a root layer, and behind its payload geometry, materials, textures.

    <name>.usda       /<name> Xform, kind component, extents hint, payload, variant sets, class to inherit from
    payload.usdc      sublayers those below
    geometry.usdc     /<name>/geo/LOD0/branches Mesh, /<name>/geo/LOD0/leaves PointInstancer
    lods.usdc         /<name>/geo/LOD1 ...: coarser levels of detail, the last one of cards; sizes to switch at
    wind.usdc         primvars:wind:* on geo and every mesh and instancer below it
    guides.usdc       /<name>/guides: the skeleton as curves, capsules to collide with
    materials.usdc    /<name>/mtl/bark, leaf, leaf_cards
    openpbr.usdc, autumn.usdc ...   what variants bring
    textures/         leaf.png (colour and cut-out), bark.png, leaf_cards.png, card_*.png, leaf_autumn.png ...
    skeleton.json     the skeleton as data

The structure is the one of the usd-wg asset guidelines.
"""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from forestgen.png import png_bytes
from forestgen.tree.level import full_level
from forestgen.tree.model import TreeModel
from forestgen.tree.skeleton_json import skeleton_json
from forestgen.usd.card_textures import AXES, card_name, define_draw_mode
from forestgen.usd.extras import BARK, LEAF, Extras, picture_path
from forestgen.usd.geometry import Box, union, vec3f
from forestgen.usd.guides import guides_layer
from forestgen.usd.layers import new_stage, require_prim_name, save
from forestgen.usd.lights import define_light_variants
from forestgen.usd.looks import LAYER as OPENPBR_LAYER
from forestgen.usd.looks import define_look_variants, look_layer
from forestgen.usd.seasons import Dress, define_seasons
from forestgen.usd.tree_layers import (
    DELIT,
    leaf_materials,
    levels_layer,
    look_materials,
    materials_layer,
    payload_layer,
)
from forestgen.usd.variants import define_lod_sizes, define_lod_variants, level_name
from forestgen.usd.wind import LAYER as WIND_LAYER
from forestgen.usd.wind import wind_layer

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
    pictures = _pictures(model, extras)
    with ThreadPoolExecutor(1) as aside:  # packing pictures takes a third of the time, and nothing of Python
        packed = aside.map(png_bytes, pictures.values())
        layers, box = _payload_layers(model, name, extras, pictures)
        layers["payload.usdc"] = payload_layer(name, [f"./{file}" for file in sorted(layers, reverse=True)])
        root, chosen = _root(model, name, box, extras, pictures)
        layers |= chosen
    (folder / "textures").mkdir(parents=True, exist_ok=True)
    for picture, data in zip(pictures, packed, strict=True):
        (folder / picture_path(picture)).write_bytes(data)
    if extras.guides:
        (folder / SKELETON).write_text(json.dumps(skeleton_json(model.skeleton), separators=(",", ":")), "utf-8")
    for file, layer in layers.items():
        save(layer, folder / file)
    return save(root, folder / f"{name}.usda")


def _pictures(model: TreeModel, extras: Extras) -> dict[str, NDArray[np.uint8]]:
    """All pictures by name; bark of one colour needs none."""
    pictures = dict(extras.pictures)
    if len(model.leaves):
        pictures[LEAF] = model.atlas.rgba
    if model.bark.rgb.shape[:2] != (1, 1):
        pictures[BARK] = model.bark.rgb
    return pictures


def _payload_layers(
    model: TreeModel, name: str, extras: Extras, pictures: dict[str, NDArray[np.uint8]]
) -> tuple[dict[str, Sdf.Layer], Box]:
    """The layers behind the payload by file, and the box (2, 3) around all levels of detail.

    No two say anything of one attribute; wind, last by name, adds to prims that others define.
    """
    full = full_level(model)
    geometry, box = levels_layer(name, [full])
    layers = {"geometry.usdc": geometry, "materials.usdc": materials_layer(name, model.bark, pictures)}
    if extras.levels:
        coarse, coarser = levels_layer(name, extras.levels, first=1)
        box = union([box, coarser])  # whichever level is chosen, nothing is beyond the extents hint
        sizes = [level.switch_px for level in extras.levels]
        define_lod_sizes(Usd.Stage.Open(coarse), Sdf.Path(f"/{name}"), sizes, box)
        layers["lods.usdc"] = coarse
    if extras.wind:
        layers[WIND_LAYER] = wind_layer(name, model.skeleton, [full, *extras.levels])
    if extras.guides:
        layers["guides.usdc"] = guides_layer(name, model.skeleton)
    return layers, box


def _root(
    model: TreeModel, name: str, box: Box, extras: Extras, pictures: dict[str, NDArray[np.uint8]]
) -> tuple[Sdf.Layer, dict[str, Sdf.Layer]]:
    """The root layer, and by file the layers that its variants bring."""
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
    if all(card_name(face) in pictures for face in AXES):
        front = pictures[card_name("ZPos")].reshape(-1, 4)
        mean = front[front[:, 3] > 0, :3].mean(axis=0) / 255 if front[:, 3].any() else np.full(3, 0.5)
        define_draw_mode(prim, {face: picture_path(card_name(face)) for face in AXES}, mean)
    return stage.GetRootLayer(), _define_variants(prim, model, extras, pictures)


def _define_variants(
    prim: Usd.Prim, model: TreeModel, extras: Extras, pictures: dict[str, NDArray[np.uint8]]
) -> dict[str, Sdf.Layer]:
    """Author the variant sets of which there is more than one variant; gives the layers that they bring, by file."""
    layers: dict[str, Sdf.Layer] = {}
    foliage = leaf_materials(pictures)
    delit = [leaf for leaf in foliage if leaf + DELIT in pictures]
    if extras.levels:
        define_lod_variants(prim, 1 + len(extras.levels))
    if extras.openpbr:
        define_look_variants(prim)
        layers[OPENPBR_LAYER] = look_layer(prim.GetName(), look_materials(model.bark, pictures))
    if delit:
        define_light_variants(prim, delit)
    if extras.seasons:
        levels = {level_name(k): level for k, level in enumerate([full_level(model), *extras.levels])}
        layers |= define_seasons(prim, extras.seasons, Dress(levels, foliage, delit, extras.openpbr))
    return layers
