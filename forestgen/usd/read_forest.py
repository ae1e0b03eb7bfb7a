"""A written scene's standing trees, read back as a Forest: prims or an instancer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom

from forestgen.errors import InputError
from forestgen.scene.forest import Forest
from forestgen.usd.layers import open_stage
from forestgen.usd.standing_trees import NAMES


def read_forest(path: Path) -> Forest:
    """The trees of a scene that a build wrote; prototypes are named after their assets' files.

    Raises:
        InputError: it is no such scene, or a tree of it stands in another way than upright and evenly scaled.
    """
    stage = open_stage(path)
    trees = stage.GetPrimAtPath(f"/{stage.GetRootLayer().defaultPrim}/trees")
    if not trees:
        raise InputError(f"{path}: has no /<scene>/trees; expected the scene that a build wrote: OUT/<scene>.usda")
    if trees.IsA(UsdGeom.PointInstancer):
        return _from_instancer(UsdGeom.PointInstancer(trees))
    standing = trees.GetChildren()
    assets = [_asset_of(prim, path) for prim in standing]
    prototypes = tuple(dict.fromkeys(assets))
    places = [_place(prim, path) for prim in standing]
    return Forest(
        prototypes=prototypes,
        names=tuple(prim.GetName() for prim in standing),
        prototype=np.array([prototypes.index(asset) for asset in assets], np.int64),
        position=np.array([place[0] for place in places], float).reshape(-1, 3),
        yaw=np.radians(np.array([place[1] for place in places], float)),
        scale=np.array([place[2] for place in places], float),
    )


def _asset_of(prim: Usd.Prim, path: Path) -> str:
    """The name of the asset that a tree references, from the layer that brings it in."""
    for spec in prim.GetPrimStack():
        references = spec.referenceList.prependedItems
        if references:
            return Path(references[0].assetPath).stem
    raise InputError(f"{path}: {prim.GetPath()} references no asset: build the scene again")


def _place(prim: Usd.Prim, path: Path) -> tuple[tuple[float, ...], float, float]:
    """Position (3,) m, degrees about +Y and scale of a tree."""
    values = [prim.GetAttribute(f"xformOp:{name}").Get() for name in ("translate", "rotateY", "scale")]
    order = UsdGeom.Xformable(prim).GetXformOpOrderAttr().Get()
    if None in values or len(order) != 3 or len(set(values[2])) != 1:
        raise InputError(f"{path}: {prim.GetPath()} stands otherwise than a build places trees: build the scene again")
    return tuple(values[0]), float(values[1]), float(values[2][0])


def _from_instancer(instancer: UsdGeom.PointInstancer) -> Forest:
    turn = np.array(instancer.GetOrientationsfAttr().Get(), float)  # i, j, k, real
    return Forest(
        prototypes=tuple(path.name for path in instancer.GetPrototypesRel().GetForwardedTargets()),
        names=tuple(instancer.GetPrim().GetAttribute(NAMES).Get()),
        prototype=np.array(instancer.GetProtoIndicesAttr().Get(), np.int64),
        position=np.array(instancer.GetPositionsAttr().Get(), float),
        yaw=2 * np.arctan2(turn[:, 1], turn[:, 3]),
        scale=np.array(instancer.GetScalesAttr().Get(), float)[:, 0],
    )
