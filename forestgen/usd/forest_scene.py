"""The scene: an assembly of trees that reference their components, a ground, lights, the photos' cameras.

/<scene>                 kind assembly
    trees                kind group; the trees and copies, which reference their components (usd/standing_trees.py)
    ground               kind component; a plane wide enough for the trees
    cameras/<tree>       references the tree's camera layer, standing where the tree stands
    lights               a sun and a sky
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from forestgen.scene.forest import Forest
from forestgen.tree.model import Mesh
from forestgen.usd.geometry import Box, define_mesh, vec3f
from forestgen.usd.layers import new_stage, relative, require_prim_name, save
from forestgen.usd.materials import define_plain_material
from forestgen.usd.standing_trees import forest_box, instancer_layer, stand, stand_as_prims

GROUND_SRGB = (0.62, 0.61, 0.56)  # dry earth, light and nearly grey: it leaves the trees the colour
GROUND_MARGIN = 0.5  # share of the tallest tree's height that the ground reaches beyond the outermost crowns
SUN_DIRECTION_DEG = (-50.0, 35.0)  # pitch about X, then heading about Y: from above, in front, to the right
SUN_IRRADIANCE = 1.2  # with the sky a white sheet stays below white; Blender 4.5 shows suns four times as bright
SUN_ANGLE_DEG = 2.0  # wider than the real sun's 0.53: softer edges of shadows
SKY_RADIANCE = 0.6
MANY = 1_000  # standing trees above which `auto` makes an instancer of them: prims cost every reader 0.1 ms and more

Instancing = Literal["auto", "native", "points"]


def write_forest(
    forest: Forest,
    assets: Mapping[str, Path],
    cameras: Mapping[str, Path],
    path: Path,
    name: str,
    *,
    instancing: Instancing = "auto",
) -> Path:
    """Write the scene `name` to `path`; give `path`.

    `assets` and `cameras` lead from a prototype's name to its written layers, which the scene
    references relative to its own folder; a prototype without cameras has none in the scene.
    `instancing` says what the trees become: `native` prims, an instancer over `points` in a layer of
    its own beside `path`, or (`auto`) prims up to 1,000 trees and an instancer above.

    Raises:
        ValueError: a name is no prim name, comes twice, or has no asset; nothing is written.
        OSError: a layer could not be read or written.
    """
    for prim_name in {name, *forest.prototypes, *forest.names}:
        require_prim_name(prim_name)
    if len(set(forest.names)) != len(forest.names):
        raise ValueError("two trees of the scene have the same prim name")
    missing = [prototype for prototype in forest.prototypes if prototype not in assets]
    if missing:
        raise ValueError(f"no asset was written for {', '.join(missing)}")

    if instancing not in get_args(Instancing):
        raise ValueError(f"instancing {instancing!r}: expected one of {', '.join(get_args(Instancing))}")

    is_native = instancing == "native" or (instancing == "auto" and len(forest) <= MANY)
    boxes = np.array([_extents_hint(assets[prototype]) for prototype in forest.prototypes]).reshape(-1, 2, 3)
    stage = new_stage(name)
    scene = UsdGeom.Xform.Define(stage, f"/{name}").GetPrim()
    Usd.ModelAPI(scene).SetKind("assembly")
    kind = UsdGeom.Xform if is_native or not len(forest) else UsdGeom.PointInstancer
    trees = kind.Define(stage, scene.GetPath().AppendChild("trees")).GetPrim()
    Usd.ModelAPI(trees).SetKind("group")
    _define_ground(stage, scene.GetPath().AppendChild("ground"), _footprint(forest, boxes))
    _define_lights(stage, scene.GetPath().AppendChild("lights"))
    layer = stage.GetRootLayer()
    del stage, scene, trees  # nothing is to be composed while ten thousand trees are added
    home = Sdf.Path(f"/{name}/trees")
    if is_native:
        stand_as_prims(layer, home, forest, assets, path.parent)
    elif len(forest):
        arrays = path.with_name(f"{name}_trees.usdc")
        save(instancer_layer(forest, assets, boxes, path.parent), arrays)
        _add_payload(layer.GetPrimAtPath(home), arrays.name, forest_box(forest, boxes))
    _add_cameras(layer, Sdf.Path(f"/{name}/cameras"), forest, cameras, path.parent)
    return save(layer, path)


def _add_payload(trees: Sdf.PrimSpec, layer: str, box: Box) -> None:
    """Let the instancer come from a layer beside the scene's, with a box for those who do not load it."""
    trees.payloadList.prependedItems = [Sdf.Payload(f"./{layer}")]
    trees.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["GeomModelAPI"]))
    Sdf.AttributeSpec(trees, "extentsHint", Sdf.ValueTypeNames.Float3Array).default = vec3f(box)


def _add_cameras(layer: Sdf.Layer, home: Sdf.Path, forest: Forest, cameras: Mapping[str, Path], folder: Path) -> None:
    """Reference each prototype's cameras once, where its first tree stands."""
    first = dict(zip(reversed(forest.prototype.tolist()), reversed(range(len(forest.names))), strict=True))
    with_camera = [k for k, prototype in enumerate(forest.prototypes) if prototype in cameras and k in first]
    if not with_camera:
        return
    with Sdf.ChangeBlock():
        parent = Sdf.PrimSpec(layer.GetPrimAtPath(home.GetParentPath()), home.name, Sdf.SpecifierDef, "Scope")
        for k in with_camera:
            tree = Sdf.PrimSpec(parent, forest.prototypes[k], Sdf.SpecifierDef, "Xform")
            reference = Sdf.Reference(relative(cameras[forest.prototypes[k]], folder))
            tree.referenceList.prependedItems = [reference]
            stand(tree, forest, first[k])


def _footprint(forest: Forest, hints: NDArray[np.float64]) -> NDArray[np.float64]:
    """Low and high corner (2, 3) in metres of the ground under trees of boxes (prototype, 2, 3); at the lowest root."""
    if not len(forest.names):
        return np.array([[-1.0, 0.0, -1.0], [1.0, 0.0, 1.0]])
    box = hints[forest.prototype] * forest.scale[:, None, None]
    reach = np.abs(box[:, :, [0, 2]]).max(axis=(1, 2))  # whichever way the tree is turned
    reach = (reach + GROUND_MARGIN * box[:, 1, 1].max())[:, None] * [1.0, 0.0, 1.0]
    low, high = (forest.position - reach).min(axis=0), (forest.position + reach).max(axis=0)
    return np.array([low, [high[0], low[1], high[2]]])


def _extents_hint(asset: Path) -> NDArray[np.float64]:
    """The box (2, 3) in metres that an asset's root layer claims for its default purpose."""
    layer = Sdf.Layer.OpenAsAnonymous(str(asset))
    if layer is None:
        raise OSError(f"{asset} could not be read")
    hint = layer.GetAttributeAtPath(Sdf.Path(f"/{layer.defaultPrim}.extentsHint"))
    if hint is None:
        raise ValueError(f"{asset}: the root prim has no extentsHint")
    return np.array(hint.default, float)[:2]


def _define_ground(stage: Usd.Stage, path: Sdf.Path, footprint: NDArray[np.float64]) -> None:
    Usd.ModelAPI(UsdGeom.Xform.Define(stage, path).GetPrim()).SetKind("component")
    mtl = UsdGeom.Scope.Define(stage, path.AppendChild("mtl")).GetPath()
    define_plain_material(stage, mtl.AppendChild("earth"), GROUND_SRGB)
    geo = UsdGeom.Scope.Define(stage, path.AppendChild("geo")).GetPath()
    (x0, y, z0), (x1, _, z1) = footprint
    plane = Mesh(
        points=np.array([[x0, y, z1], [x1, y, z1], [x1, y, z0], [x0, y, z0]]),
        normals=np.tile([0.0, 1.0, 0.0], (4, 1)),
        uv=np.array([[x0, -z1], [x1, -z1], [x1, -z0], [x0, -z0]]),  # metres, so that a texture keeps its scale
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
    )
    define_mesh(stage, geo.AppendChild("plane"), plane, mtl.AppendChild("earth"))


def _define_lights(stage: Usd.Stage, path: Sdf.Path) -> None:
    """A soft afternoon: readers that honour lights show something at once."""
    UsdGeom.Scope.Define(stage, path)
    sun = UsdLux.DistantLight.Define(stage, path.AppendChild("sun"))
    sun.CreateIntensityAttr(SUN_IRRADIANCE)
    sun.CreateNormalizeAttr(True)  # so that the intensity is what arrives, however wide the sun
    sun.CreateAngleAttr(SUN_ANGLE_DEG)
    sun.CreateColorAttr(Gf.Vec3f(1.0, 0.96, 0.9))
    pitch, heading = SUN_DIRECTION_DEG
    sun.AddRotateYOp().Set(heading)
    sun.AddRotateXOp().Set(pitch)
    sky = UsdLux.DomeLight.Define(stage, path.AppendChild("sky"))
    sky.CreateIntensityAttr(SKY_RADIANCE)
    sky.CreateColorAttr(Gf.Vec3f(0.82, 0.9, 1.0))
