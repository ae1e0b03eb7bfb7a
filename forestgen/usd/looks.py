"""The second look of a tree's materials: OpenPBR as a MaterialX network, with leaves that let light through.

    openpbr.usdc          over /<tree>/mtl/<material>: shader nodes, and the terminal outputs:mtlx:surface
    variant set look      preview (default): UsdPreviewSurface alone; openpbr: the layer above as a payload

With `openpbr` both terminals are there: a renderer that asks for MaterialX takes that one, all others the preview
surface, which is the last resort of every renderer (outputs:surface). The network is no part of the default: some
viewports take MaterialX whenever it is there and cannot be told not to (maya-usd #2637), and a USD without MaterialX
reports each node as unknown. MaterialX up to 1.39.5 squares subsurface_color in the thin-walled mode (MaterialX #3027):
there leaves let less light through than the specification says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdShade

from forestgen.usd.layers import new_stage
from forestgen.usd.materials import BARK_ROUGHNESS, LEAF_ROUGHNESS, OPACITY_THRESHOLD, linear_from_srgb
from forestgen.usd.mtlx_nodes import type_of

LOOK_SET, PREVIEW, OPENPBR = "look", "preview", "openpbr"
LAYER = "openpbr.usdc"
CONTEXT = "mtlx"  # render context of the terminal
COLOUR_SPACE = "srgb_texture"  # MaterialX' name of it
THROUGH = 0.4  # subsurface_weight: this much of the light goes through the blade's tissue, half of that to the other
# side; ours: measured leaves let through as much as they reflect, but a photo's colour is reflection only

PICTURE, PICTURE_DELIT, DELIT_SHARE = "openpbr_picture", "openpbr_picture_delit", "delit"  # inputs of the material
TYPES = Sdf.ValueTypeNames


@dataclass(frozen=True, eq=False)
class LookMaterial:
    """One material of a tree, by its name below mtl: what its surface shows."""

    name: str
    picture: str = ""  # asset path; plain `colour` where empty
    colour: NDArray[np.float64] | None = None  # (3,) sRGB in [0, 1]
    is_leaf: bool = False  # thin-walled, cut out by the picture's alpha
    delit: str = ""  # asset path of the picture without baked light, where there is one

    def __post_init__(self) -> None:
        if not self.picture and self.colour is None:
            raise ValueError(f"material {self.name!r} has neither a picture nor a colour")
        if self.is_leaf and not self.picture:
            raise ValueError(f"leaf material {self.name!r} needs a picture: its alpha is the leaf's outline")


def look_layer(tree: str, materials: Sequence[LookMaterial]) -> Sdf.Layer:
    """The layer of OpenPBR networks of a tree's materials; save it as LAYER beside the tree's other layers."""
    stage = new_stage(tree)
    for material in materials:
        _define_network(stage, Sdf.Path(f"/{tree}/mtl/{material.name}"), material)
    return stage.GetRootLayer()


def define_look_variants(root: Usd.Prim) -> None:
    """Author the variant set on a tree's root prim; the preview look is selected."""
    choice = root.GetVariantSets().AddVariantSet(LOOK_SET)
    for variant in (PREVIEW, OPENPBR):
        choice.AddVariant(variant)
    choice.SetVariantSelection(OPENPBR)
    with choice.GetVariantEditContext():
        root.GetPayloads().AddPayload(f"./{LAYER}")
    choice.SetVariantSelection(PREVIEW)


def _define_network(stage: Usd.Stage, path: Sdf.Path, look: LookMaterial) -> None:
    surface = _node(stage, path, "openpbr", "ND_open_pbr_surface_surfaceshader")
    _set(surface, specular_roughness=LEAF_ROUGHNESS if look.is_leaf else BARK_ROUGHNESS)
    if not look.picture:
        srgb = look.colour if look.colour is not None else np.zeros(3)
        _set(surface, base_color=Gf.Vec3f(*linear_from_srgb(srgb).tolist()))
    elif look.is_leaf:
        _connect_leaf(stage, path, surface, look)
    else:
        _link(surface, "base_color", _image(stage, path, PICTURE, "ND_image_color3", look.picture, "periodic"))
    material = UsdShade.Material(stage.OverridePrim(path))
    material.CreateSurfaceOutput(CONTEXT).ConnectToSource(surface.CreateOutput("out", TYPES.Token))


def _connect_leaf(stage: Usd.Stage, path: Sdf.Path, surface: UsdShade.Shader, look: LookMaterial) -> None:
    """A blade of no thickness: colour and cut-out from one picture, part of the light comes through.

    Where there is a picture without light too, the material's input DELIT_SHARE mixes the colours of both.
    """
    image = _image(stage, path, PICTURE, "ND_image_color4", look.picture, "clamp")
    colour = _node(stage, path, "openpbr_colour", "ND_convert_color4_color3")
    _link(colour, "in", image)
    if look.delit:
        delit = _image(stage, path, PICTURE_DELIT, "ND_image_color3", look.delit, "clamp")
        mix = _node(stage, path, "openpbr_light", "ND_mix_color3")
        _link(mix, "fg", delit)
        _link(mix, "bg", colour)
        share = UsdShade.Material(stage.OverridePrim(path)).CreateInput(DELIT_SHARE, TYPES.Float)
        share.Set(0.0)
        mix.CreateInput("mix", TYPES.Float).ConnectToSource(share)
        colour = mix
    alpha = _node(stage, path, "openpbr_alpha", "ND_extract_color4")
    _link(alpha, "in", image)
    _set(alpha, index=3)
    cut = _node(stage, path, "openpbr_cut", "ND_ifgreatereq_float")
    _link(cut, "value1", alpha)
    _set(cut, value2=OPACITY_THRESHOLD, in1=1.0, in2=0.0)
    _link(surface, "base_color", colour)
    _link(surface, "subsurface_color", colour)
    _link(surface, "geometry_opacity", cut)
    _set(surface, geometry_thin_walled=True, subsurface_weight=THROUGH)


def _node(stage: Usd.Stage, material: Sdf.Path, name: str, identifier: str) -> UsdShade.Shader:
    shader = UsdShade.Shader.Define(stage, material.AppendChild(name))
    shader.CreateIdAttr(identifier)
    return shader


def _image(stage: Usd.Stage, path: Sdf.Path, name: str, identifier: str, picture: str, wrap: str) -> UsdShade.Shader:
    """A texture node at `st`; its file is the material's input of the same name, so that seasons can set it."""
    image = _node(stage, path, name, identifier)
    asked = UsdShade.Material(stage.OverridePrim(path)).CreateInput(name, TYPES.Asset)
    asked.Set(Sdf.AssetPath(picture))
    file = image.CreateInput("file", TYPES.Asset)
    file.ConnectToSource(asked)
    for entry in (asked, file):
        entry.GetAttr().SetColorSpace(COLOUR_SPACE)
    _set(image, uaddressmode=wrap, vaddressmode=wrap)
    st = _node(stage, path, "openpbr_st", "ND_geompropvalue_vector2")
    _set(st, geomprop="st")
    _link(image, "texcoord", st)
    return image


def _set(shader: UsdShade.Shader, **values: object) -> None:
    """Give inputs values, of the types that the table of nodes says."""
    for name, value in values.items():
        shader.CreateInput(name, type_of(shader, f"inputs:{name}")).Set(value)


def _link(shader: UsdShade.Shader, name: str, source: UsdShade.Shader) -> None:
    output = source.CreateOutput("out", type_of(source, "outputs:out"))
    shader.CreateInput(name, type_of(shader, f"inputs:{name}")).ConnectToSource(output)
