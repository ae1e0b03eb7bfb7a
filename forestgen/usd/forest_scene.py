"""The scene: an assembly of trees that reference their components, a ground, lights, the photos' cameras.

/<scene>                 kind assembly
    trees                kind group; every tree and copy an instanceable Xform that references its component
    ground               kind component; a plane wide enough for the trees
    cameras/<tree>       references the tree's camera layer, standing where the tree stands
    lights               a sun and a sky
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, Vt

from forestgen.scene.forest import Forest
from forestgen.tree.model import Mesh
from forestgen.usd.geometry import define_mesh
from forestgen.usd.layers import new_stage, relative, require_prim_name, save
from forestgen.usd.materials import define_plain_material

GROUND_SRGB = (0.62, 0.61, 0.56)  # dry earth, light and nearly grey: it leaves the trees the colour
GROUND_MARGIN = 0.5  # share of the tallest tree's height that the ground reaches beyond the outermost crowns
SUN_DIRECTION_DEG = (-50.0, 35.0)  # pitch about X, then heading about Y: from above, in front, to the right
SUN_IRRADIANCE = 1.2  # with the sky a white sheet stays below white; Blender 4.5 shows suns four times as bright
SUN_ANGLE_DEG = 2.0  # wider than the real sun's 0.53: softer edges of shadows
SKY_RADIANCE = 0.6
ORDER = Vt.TokenArray(["xformOp:translate", "xformOp:rotateY", "xformOp:scale"])


def write_forest(
    forest: Forest, assets: Mapping[str, Path], cameras: Mapping[str, Path], path: Path, name: str
) -> Path:
    """Write the scene `name` to `path`; give `path`.

    `assets` and `cameras` lead from a prototype's name to its written layers, which the scene
    references relative to its own folder; a prototype without cameras has none in the scene.

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

    stage = new_stage(name)
    scene = UsdGeom.Xform.Define(stage, f"/{name}").GetPrim()
    Usd.ModelAPI(scene).SetKind("assembly")
    trees = UsdGeom.Xform.Define(stage, scene.GetPath().AppendChild("trees")).GetPrim()
    Usd.ModelAPI(trees).SetKind("group")
    _define_ground(stage, scene.GetPath().AppendChild("ground"), _footprint(forest, assets))
    _define_lights(stage, scene.GetPath().AppendChild("lights"))
    layer = stage.GetRootLayer()
    del stage, scene, trees  # nothing is to be composed while ten thousand trees are added
    _add_trees(layer, Sdf.Path(f"/{name}/trees"), forest, assets, path.parent)
    _add_cameras(layer, Sdf.Path(f"/{name}/cameras"), forest, cameras, path.parent)
    return save(layer, path)


def _add_trees(layer: Sdf.Layer, home: Sdf.Path, forest: Forest, assets: Mapping[str, Path], folder: Path) -> None:
    """Add every tree below `home`, by Sdf in one change block: a hundredth of the time of the schema classes."""
    references = [Sdf.Reference(relative(assets[prototype], folder)) for prototype in forest.prototypes]
    parent = layer.GetPrimAtPath(home)
    with Sdf.ChangeBlock():
        for k, (name, prototype) in enumerate(zip(forest.names, forest.prototype.tolist(), strict=True)):
            tree = Sdf.PrimSpec(parent, name, Sdf.SpecifierDef, "Xform")
            tree.instanceable = True
            tree.referenceList.prependedItems = [references[prototype]]
            _stand(tree, forest, k)


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
            _stand(tree, forest, first[k])


def _stand(prim: Sdf.PrimSpec, forest: Forest, k: int) -> None:
    """Author where tree k of the forest stands."""
    types = Sdf.ValueTypeNames
    scale = float(forest.scale[k])
    values = (
        ("xformOp:translate", types.Double3, Gf.Vec3d(*forest.position[k].tolist())),
        ("xformOp:rotateY", types.Float, float(np.degrees(forest.yaw[k]))),
        ("xformOp:scale", types.Float3, Gf.Vec3f(scale, scale, scale)),
    )
    for name, kind, value in values:
        Sdf.AttributeSpec(prim, name, kind).default = value
    Sdf.AttributeSpec(prim, "xformOpOrder", types.TokenArray, Sdf.VariabilityUniform).default = ORDER


def _footprint(forest: Forest, assets: Mapping[str, Path]) -> NDArray[np.float64]:
    """Low and high corner (2, 3) in metres of the ground under the trees; flat, at the lowest root."""
    if not len(forest.names):
        return np.array([[-1.0, 0.0, -1.0], [1.0, 0.0, 1.0]])
    hints = np.stack([_extents_hint(assets[prototype]) for prototype in forest.prototypes])  # (prototype, 2, 3)
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
