"""Surfaces: what a UsdPreviewSurface network looks like, as one texture, one colour and one threshold."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pxr import Ar, Gf, Usd, UsdGeom, UsdShade

from forestgen.errors import InputError
from forestgen.usd.materials import linear_from_srgb, srgb_from_linear

GREY = 0.18  # linear; what USD shows where nothing is said


@dataclass(frozen=True, eq=False)
class Surface:
    """How a mesh's faces look; texture rows from the top, values sRGB with straight alpha."""

    name: str = ""  # the material's
    texture: NDArray[np.uint8] | None = None  # (H, W, 4), read-only: many meshes share it
    colour: NDArray[np.float64] = field(default_factory=lambda: np.ones(4))  # (4,) sRGB and alpha
    alpha_threshold: float = 0.0
    st: str = "st"  # the primvar that the texture reads
    uv_matrix: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))  # on (u, v, 1)


def surface_of(prim: Usd.Prim, known: dict[str, Surface]) -> Surface:
    """The surface bound to a prim or material subset; `known` remembers those already read, by path.

    Without a material it is the prim's own constant displayColor, or grey.

    Raises:
        InputError: a texture is missing or no image.
    """
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    if not material:
        return Surface(colour=_display_colour(prim))
    path = str(material.GetPath())
    if path not in known:
        known[path] = _read(material)
    return known[path]


def _display_colour(prim: Usd.Prim) -> NDArray[np.float64]:
    api = UsdGeom.PrimvarsAPI(prim)
    rgb, alpha = (api.FindPrimvarWithInheritance(f"display{part}") for part in ("Color", "Opacity"))
    colour = np.array(rgb.Get(), float).reshape(-1, 3).mean(axis=0) if rgb and rgb.HasValue() else np.full(3, GREY)
    opacity = np.array(alpha.Get(), float).mean() if alpha and alpha.HasValue() else 1.0
    return np.array([*srgb_from_linear(colour), opacity])


def _read(material: UsdShade.Material) -> Surface:
    name = material.GetPrim().GetName()
    shader = material.ComputeSurfaceSource()[0]
    if not shader or shader.GetIdAttr().Get() != "UsdPreviewSurface":
        return Surface(name=name, colour=np.array([*srgb_from_linear(np.full(3, GREY)), 1.0]))
    rgb, rgb_node = _input(shader, "diffuseColor", Gf.Vec3f(GREY))
    alpha, alpha_node = _input(shader, "opacity", 1.0)
    threshold, _ = _input(shader, "opacityThreshold", 0.0)
    colour = np.ones(4)
    if rgb_node is None:
        colour[:3] = srgb_from_linear(np.array(rgb, float))
    if alpha_node is None:
        colour[3] = float(alpha)
    texture = _compose(rgb_node, alpha_node)
    node = rgb_node or alpha_node
    st, uv_matrix = ("st", np.eye(3)) if node is None else _coordinates(node[0])
    return Surface(name, texture, colour, float(threshold), st, uv_matrix)


Node = tuple[UsdShade.Shader, str]  # a texture and the output that is read: rgb, r, g, b or a


def _input(shader: UsdShade.Shader, name: str, default: object) -> tuple[Any, Node | None]:
    """The value of an input, and the texture that drives it, if one does."""
    entry = shader.GetInput(name)
    if not entry:
        return default, None
    for attribute in entry.GetValueProducingAttributes():
        source = UsdShade.Shader(attribute.GetPrim())
        is_output = attribute.GetName().startswith("outputs:")
        if is_output and source and source.GetIdAttr().Get() == "UsdUVTexture":
            return default, (source, attribute.GetBaseName())
        if attribute.Get() is not None:
            return attribute.Get(), None
    return default, None


def _compose(rgb: Node | None, alpha: Node | None) -> NDArray[np.uint8] | None:
    """One picture (H, W, 4) of the colour of the one texture and the opacity of the other."""
    if rgb is None and alpha is None:
        return None
    colour = None if rgb is None else _texels(rgb[0], is_colour=True)[..., :3]
    mask = None if alpha is None else _texels(alpha[0], is_colour=False)[..., "rgba".index(alpha[1][0])]
    height, width = next(part for part in (colour, mask) if part is not None).shape[:2]
    texture = np.full((height, width, 4), 255, np.uint8)
    if colour is not None:
        texture[..., :3] = np.round(colour * 255)
    if mask is not None:
        texture[..., 3] = np.round(cv2.resize(mask, (width, height), interpolation=cv2.INTER_LINEAR) * 255)
    texture.setflags(write=False)
    return texture


def _texels(shader: UsdShade.Shader, *, is_colour: bool) -> NDArray[np.float32]:
    """A texture node's output (H, W, 4) in [0, 1], colour sRGB-encoded; its scale and bias applied."""
    image = _load(shader)
    scale, bias = (
        np.array(_input(shader, name, default)[0], np.float32)
        for name, default in (("scale", (1, 1, 1, 1)), ("bias", (0, 0, 0, 0)))
    )
    is_raw = _input(shader, "sourceColorSpace", "auto")[0] == "raw"
    is_plain = bool(np.all(scale == 1) and np.all(bias == 0))
    if is_colour and (is_raw or not is_plain):
        linear = image[..., :3] if is_raw else linear_from_srgb(image[..., :3])
        image[..., :3] = srgb_from_linear(linear * scale[:3] + bias[:3])
    elif not is_plain:
        image = np.clip(image * scale + bias, 0, 1)
    return image


def _load(shader: UsdShade.Shader) -> NDArray[np.float32]:
    """The picture file of a texture node (H, W, 4) in [0, 1]; grey and missing alpha filled in."""
    asset, _ = _input(shader, "file", None)
    where = f"{shader.GetPath()}: inputs:file"
    if asset is None:
        raise InputError(f"{where} is empty; a texture node needs a picture file")
    path = asset.resolvedPath or asset.path
    opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))  # a file, or a part of a package
    if not opened:
        raise InputError(f"{where} leads to {asset.path}, which is not there")
    data = np.frombuffer(bytes(opened.GetBuffer()), np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if len(data) else None
    if image is None or image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{where}: {path} is no picture of 8 or 16 bits")
    value = image.astype(np.float32) / (255 if image.dtype == np.uint8 else 65535)
    value = value.reshape(*value.shape[:2], -1)
    full = np.ones((*value.shape[:2], 4), np.float32)
    if value.shape[2] <= 2:
        full[..., :3] = value[..., :1]
        full[..., 3:] = value[..., 1:] if value.shape[2] > 1 else 1.0
    else:
        full[..., :3] = value[..., 2::-1]
        full[..., 3:] = value[..., 3:] if value.shape[2] > 3 else 1.0
    return full


def _coordinates(shader: UsdShade.Shader) -> tuple[str, NDArray[np.float64]]:
    """The primvar that a texture node reads, and the matrix (3, 3) that it passes through."""
    matrix = np.eye(3)
    entry = shader.GetInput("st")
    while entry:
        sources = entry.GetValueProducingAttributes()
        node = UsdShade.Shader(sources[0].GetPrim()) if sources else None
        if not node:
            break
        if node.GetIdAttr().Get() == "UsdTransform2d":
            matrix = matrix @ _transform_2d(node)
            entry = node.GetInput("in")
            continue
        name, _ = _input(node, "varname", "st")
        return str(name), matrix
    return "st", matrix


def _transform_2d(node: UsdShade.Shader) -> NDArray[np.float64]:
    """The matrix (3, 3) of a UsdTransform2d: scale, then turn (degrees, anticlockwise), then shift."""
    turn = np.radians(float(_input(node, "rotation", 0.0)[0]))
    scale, shift = (np.array(_input(node, key, d)[0], float) for key, d in (("scale", (1, 1)), ("translation", (0, 0))))
    matrix = np.eye(3)
    matrix[:2, :2] = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) * scale
    matrix[:2, 2] = shift
    return matrix
