"""Materials: leaf and bark as UsdPreviewSurface, textured from the photo."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike
from pxr import Gf, Sdf, Usd, UsdShade, Vt

from forestgen.tree.srgb import linear_from_srgb as linear_from_srgb
from forestgen.tree.srgb import srgb_from_linear as srgb_from_linear

LEAF_ROUGHNESS = 0.6  # a cuticle shines a little; the photo's own lights are in the atlas already
BARK_ROUGHNESS = 0.95
MIP_THRESHOLDS = "forestgen:mipThresholds"  # custom data of a leaf material
OPACITY_THRESHOLD = 0.5  # DESIGN section 6: mattes count from one half on


def define_leaf_material(stage: Usd.Stage, path: Sdf.Path, texture: str) -> None:
    """Author the cut-out leaf: colour and opacity from one texture (asset path), through one node.

    No scale on the node: Blender bakes it into the opacity.
    """
    surface = _define_surface(stage, path, LEAF_ROUGHNESS)
    image = _define_texture(stage, path, texture, "clamp")
    _connect(surface, "diffuseColor", Sdf.ValueTypeNames.Color3f, image, "rgb", Sdf.ValueTypeNames.Float3)
    _connect(surface, "opacity", Sdf.ValueTypeNames.Float, image, "a", Sdf.ValueTypeNames.Float)
    surface.CreateInput("opacityThreshold", Sdf.ValueTypeNames.Float).Set(OPACITY_THRESHOLD)
    surface.CreateInput("opacityMode", Sdf.ValueTypeNames.Token).Set("presence")


def set_mip_thresholds(stage: Usd.Stage, path: Sdf.Path, thresholds: Sequence[float]) -> None:
    """Note on a leaf material what plain mip levels of its texture are to be tested against, level 0 first.

    For engines that make their own mip levels: USD and MaterialX have no place for it (see docs/seasons-and-looks.md).
    """
    values = Vt.DoubleArray([float(value) for value in thresholds])
    stage.GetPrimAtPath(path).SetCustomDataByKey(MIP_THRESHOLDS, values)


def define_textured_material(stage: Usd.Stage, path: Sdf.Path, texture: str) -> None:
    """Author bark: colour from a tile (asset path) that repeats."""
    surface = _define_surface(stage, path, BARK_ROUGHNESS)
    image = _define_texture(stage, path, texture, "repeat")
    _connect(surface, "diffuseColor", Sdf.ValueTypeNames.Color3f, image, "rgb", Sdf.ValueTypeNames.Float3)


def define_plain_material(stage: Usd.Stage, path: Sdf.Path, srgb: ArrayLike) -> None:
    """Author a matt surface of one colour (3,), sRGB in [0, 1]."""
    surface = _define_surface(stage, path, BARK_ROUGHNESS)
    colour = Gf.Vec3f(*linear_from_srgb(srgb).tolist())
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(colour)


def _define_surface(stage: Usd.Stage, path: Sdf.Path, roughness: float) -> UsdShade.Shader:
    material = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, path.AppendChild("surface"))
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(roughness)
    surface.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    surface.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    return surface


def _define_texture(stage: Usd.Stage, path: Sdf.Path, texture: str, wrap: str) -> UsdShade.Shader:
    reader = UsdShade.Shader.Define(stage, path.AppendChild("st_reader"))
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    image = UsdShade.Shader.Define(stage, path.AppendChild("texture"))
    image.CreateIdAttr("UsdUVTexture")
    image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(texture))
    image.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
    for side in ("wrapS", "wrapT"):
        image.CreateInput(side, Sdf.ValueTypeNames.Token).Set(wrap)
    _connect(image, "st", Sdf.ValueTypeNames.Float2, reader, "result", Sdf.ValueTypeNames.Float2)
    return image


def _connect(
    shader: UsdShade.Shader,
    name: str,
    kind: Sdf.ValueTypeName,
    source: UsdShade.Shader,
    output: str,
    output_kind: Sdf.ValueTypeName,
) -> None:
    source.CreateOutput(output, output_kind)
    shader.CreateInput(name, kind).ConnectToSource(source.ConnectableAPI(), output)
