"""Profiles web and arkit: one .usdz with one level of detail; no instances, variants, payloads or cameras.

    /<tree>         Xform, kind component         a scene: /<scene> assembly, its components below, all
        geo         Scope: one Mesh a material    standings of a tree in one of them
        mtl         Scope: UsdPreviewSurface

three.js draws what instancers hold once, at the origin, and ARKit refuses them. Texture coordinates are stored by
corner: three.js 0.187 takes indices for those of corners, whatever the interpolation says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from pxr import Sdf, Usd, UsdGeom

from forestgen.errors import InputError
from forestgen.render.drawable import Drawable
from forestgen.usd.component import define_component, take_materials
from forestgen.usd.composed import Composed, Part
from forestgen.usd.geometry import define_mesh, union, vec3f
from forestgen.usd.layers import new_stage, save
from forestgen.usd.package import write_usdz


def write_flat(root: Path, folder: Path, variants: Mapping[str, str], level: int | None, max_triangles: int) -> Path:
    """Write the tree or scene of a root layer as `folder`/<name>.usdz; give its path.

    `level` None: the finest with at most `max_triangles` in all.

    Raises:
        InputError: no such level or variant, none is small enough, or a file is missing or broken.
        OSError: the file could not be written.
    """
    composed = Composed(root, variants)
    parts = composed.parts(_chosen(composed, level, max_triangles))
    stage = new_stage(composed.name)
    top = Sdf.Path(f"/{composed.name}")
    if not composed.is_tree:
        Usd.ModelAPI(UsdGeom.Xform.Define(stage, top).GetPrim()).SetKind("assembly")
    pictures: dict[str, Path] = {}
    for component in dict.fromkeys(part.component for part in parts):
        path, home = (top, "textures") if composed.is_tree else (top.AppendChild(component), f"{component}/textures")
        pictures |= _define(stage, path, composed, [part for part in parts if part.component == component], home)
    layer = save(stage.GetRootLayer(), folder / f"{composed.name}.usdc")
    packed = write_usdz(folder / f"{composed.name}.usdz", {layer.name: layer, **pictures})
    layer.unlink()
    return packed


def _chosen(composed: Composed, level: int | None, max_triangles: int) -> list[Drawable]:
    if level is not None:
        composed.select_level(level)
        return composed.drawables()
    counts = []
    for k in range(composed.n_levels()):
        composed.select_level(k)
        found = composed.drawables()
        counts.append(sum(drawable.n_triangles for drawable in found))
        if counts[-1] <= max_triangles:
            return found
    told = ", ".join(f"level {k}: {count:,}" for k, count in enumerate(counts))
    raise InputError(
        f"{composed.path}: no level of detail has at most {max_triangles:,} triangles ({told});"
        f" give --max-triangles {max_triangles}, or name a level with --level"
    )


def _define(
    stage: Usd.Stage, path: Sdf.Path, composed: Composed, parts: Sequence[Part], folder: str
) -> dict[str, Path]:
    """Author one component from its parts; give the pictures it needs, by their names in the package."""
    source = composed.stage.GetPrimAtPath(parts[0].owner)
    prim = define_component(stage, path, source, f"{composed.name}.usdz")
    mtl = path.AppendChild("mtl")
    pictures = take_materials(composed, (part.material for part in parts), stage.GetRootLayer(), mtl, folder)
    geo = UsdGeom.Scope.Define(stage, path.AppendChild("geo")).GetPath()
    boxes = []
    for part in parts:
        where, material = geo.AppendChild(part.name), mtl.AppendChild(part.material.name)
        boxes.append(define_mesh(stage, where, part.mesh, material, by_corner=True))
    UsdGeom.ModelAPI.Apply(prim).SetExtentsHint(vec3f(union(boxes)))
    return pictures
