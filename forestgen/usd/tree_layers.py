"""The layers behind a tree's payload: levels of detail, materials, and the payload that brings them all."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, UsdGeom

from forestgen.tree.level import Level
from forestgen.tree.mips import build_mips
from forestgen.tree.model import Bark
from forestgen.usd.extras import BARK, CARDS, LEAF, picture_path
from forestgen.usd.geometry import Box, define_leaves, define_mesh, union
from forestgen.usd.layers import new_stage
from forestgen.usd.lights import define_delit_texture
from forestgen.usd.looks import LookMaterial
from forestgen.usd.materials import (
    define_leaf_material,
    define_plain_material,
    define_textured_material,
    set_mip_thresholds,
)
from forestgen.usd.variants import level_name

DELIT = "_delit"  # ending of a picture's name


def levels_layer(name: str, levels: Sequence[Level], first: int = 0) -> tuple[Sdf.Layer, Box]:
    """The layer of some levels of detail, numbered from `first`, and the box (2, 3) around them.

    Raises:
        ValueError: a level cannot be drawn, or the full tree has no wood.
    """
    stage = new_stage(name)
    tree = UsdGeom.Xform.Define(stage, f"/{name}").GetPath()
    geo = UsdGeom.Scope.Define(stage, tree.AppendChild("geo")).GetPath()
    mtl = tree.AppendChild("mtl")
    boxes = []
    for k, level in enumerate(levels, start=first):
        home = UsdGeom.Xform.Define(stage, geo.AppendChild(level_name(k))).GetPath()
        if len(level.mesh.faces) or not k:
            boxes.append(define_mesh(stage, home.AppendChild("branches"), level.mesh, mtl.AppendChild(BARK)))
        if len(level.leaves):
            leaves = home.AppendChild("leaves")
            boxes.append(define_leaves(stage, leaves, level.leaves, level.prototypes, mtl.AppendChild(LEAF)))
        if len(level.cards.faces):
            boxes.append(define_mesh(stage, home.AppendChild(CARDS), level.cards, mtl.AppendChild(CARDS)))
    return stage.GetRootLayer(), union(boxes)


def materials_layer(name: str, bark: Bark, pictures: dict[str, NDArray[np.uint8]]) -> Sdf.Layer:
    """The layer of bark, and of leaves and cards where they have a picture."""
    stage = new_stage(name)
    tree = UsdGeom.Xform.Define(stage, f"/{name}").GetPath()
    mtl = UsdGeom.Scope.Define(stage, tree.AppendChild("mtl")).GetPath()
    if BARK in pictures:
        define_textured_material(stage, mtl.AppendChild(BARK), picture_path(BARK))
    else:
        define_plain_material(stage, mtl.AppendChild(BARK), bark.rgb[0, 0] / 255)
    for leaf in leaf_materials(pictures):
        material = mtl.AppendChild(leaf)
        define_leaf_material(stage, material, picture_path(leaf))
        set_mip_thresholds(stage, material, build_mips(pictures[leaf]).thresholds.tolist())
        if leaf + DELIT in pictures:
            define_delit_texture(stage, material, picture_path(leaf + DELIT))
    return stage.GetRootLayer()


def leaf_materials(pictures: Collection[str]) -> list[str]:
    """The names of the materials of foliage that have a picture."""
    return [name for name in (LEAF, CARDS) if name in pictures]


def look_materials(bark: Bark, pictures: Collection[str]) -> list[LookMaterial]:
    """The materials as the second look makes them."""
    plain = bark.rgb[0, 0] / 255
    wood = LookMaterial(BARK, picture_path(BARK) if BARK in pictures else "", None if BARK in pictures else plain)
    foliage = [
        LookMaterial(
            name,
            picture_path(name),
            is_leaf=True,
            delit=picture_path(name + DELIT) if name + DELIT in pictures else "",
        )
        for name in leaf_materials(pictures)
    ]
    return [wood, *foliage]


def payload_layer(name: str, layers: Sequence[str]) -> Sdf.Layer:
    """The layer that brings others, the strongest first."""
    layer = new_stage(name).GetRootLayer()
    Sdf.CreatePrimInLayer(layer, f"/{name}").specifier = Sdf.SpecifierOver
    layer.subLayerPaths = list(layers)
    return layer
