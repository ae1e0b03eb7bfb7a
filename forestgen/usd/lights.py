"""Leaf colours with or without the photo's own light, chosen by a variant: baked (default) or delit.

    /<tree>/mtl/<material>/texture_delit    a second texture node, read by nothing
    variant set light                       delit: the preview surface reads that node instead, and the input
                                            `delit` of the material, by which the OpenPBR look mixes, is 1

The choice is not one of files, so it goes with every season: each season names both. (Variant sets inside variants
would do too, but not every reader takes those: LightUSD #94, #228.)
"""

from __future__ import annotations

from collections.abc import Collection

from pxr import Sdf, Usd, UsdShade

from forestgen.usd.looks import DELIT_SHARE
from forestgen.usd.specs import add_strongest_set, attribute, over

LIGHT_SET, BAKED, DELIT = "light", "baked", "delit"
TEXTURE, TEXTURE_DELIT = "texture", "texture_delit"


def define_delit_texture(stage: Usd.Stage, material: Sdf.Path, picture: str) -> None:
    """Author the second texture node of a leaf material that is on the stage: as the first, with another picture.

    Raises:
        ValueError: there is no such material with a texture node.
    """
    first = UsdShade.Shader(stage.GetPrimAtPath(material.AppendChild(TEXTURE)))
    if not first:
        raise ValueError(f"{material} has no node {TEXTURE!r} that a second texture could stand for")
    layer = stage.GetEditTarget().GetLayer()
    path = material.AppendChild(TEXTURE_DELIT)
    Sdf.CopySpec(layer, first.GetPath(), layer, path)
    UsdShade.Shader(stage.GetPrimAtPath(path)).GetInput("file").Set(Sdf.AssetPath(picture))


def define_light_variants(root: Usd.Prim, materials: Collection[str]) -> None:
    """Author the variant set on a tree's root prim for the leaf materials that have both textures; baked is selected.

    Raises:
        ValueError: no material is named.
    """
    if not materials:
        raise ValueError(f"{root.GetPath()}: variants of light need a material with two textures")
    delit = add_strongest_set(root, LIGHT_SET, (BAKED, DELIT))[DELIT]
    for name in sorted(materials):
        material = over(delit, f"mtl/{name}")
        attribute(material, f"inputs:{DELIT_SHARE}", Sdf.ValueTypeNames.Float).default = 1.0
        surface = over(material, "surface")
        picture = root.GetPath().AppendPath(f"mtl/{name}/{TEXTURE_DELIT}")
        for entry, kind, output in (("diffuseColor", "color3f", "rgb"), ("opacity", "float", "a")):
            reading = attribute(surface, f"inputs:{entry}", Sdf.ValueTypeNames.Find(kind))
            reading.connectionPathList.explicitItems = [picture.AppendProperty(f"outputs:{output}")]
