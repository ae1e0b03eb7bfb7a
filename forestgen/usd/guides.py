"""Guides: what is not drawn but of use, below /<name>/guides: the skeleton as curves, capsules for collision.

guides               Scope, purpose guide
  skeleton           BasisCurves: one a limb, from where it leaves its parent to its tip; widths are diameters
  collision          Scope
    trunk_00, limb_00, ...   Capsules with UsdPhysics' collision API
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, Vt

from forestgen.tree.capsules import Capsules, collision_capsules
from forestgen.tree.limb_tree import LimbTree, limb_tree
from forestgen.tree.limbs import unit
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.wind import wind_of
from forestgen.usd.geometry import vec3f
from forestgen.usd.layers import new_stage

LAYER = "guides.usdc"


def guides_layer(name: str, skeleton: Skeleton) -> Sdf.Layer:
    """The skeleton and the collision capsules of a tree, as /<name>/guides.

    Raises:
        ValueError: a radius of the skeleton is NaN or negative.
    """
    tree = limb_tree(skeleton)
    stage = new_stage(name)
    root = UsdGeom.Xform.Define(stage, f"/{name}").GetPath()
    guides = UsdGeom.Scope.Define(stage, root.AppendChild("guides"))
    guides.CreatePurposeAttr(UsdGeom.Tokens.guide)
    define_skeleton(stage, guides.GetPath().AppendChild("skeleton"), tree)
    define_capsules(stage, guides.GetPath().AppendChild("collision"), collision_capsules(tree))
    return stage.GetRootLayer()


def define_skeleton(stage: Usd.Stage, path: Sdf.Path, tree: LimbTree) -> UsdGeom.BasisCurves:
    """Author the limbs (L,) of a skeleton as linear curves: points, widths a point, the limb's level a curve."""
    limbs, skeleton = tree.limbs, tree.skeleton
    point = skeleton.position[limbs.node].astype(np.float32)
    width = 2 * skeleton.radius[limbs.node]
    own = limbs.first[1:-1]
    width[own] = np.minimum(width[own], width[own + 1])  # where a side limb leaves it is no thicker than itself
    curves = UsdGeom.BasisCurves.Define(stage, path)
    curves.CreateTypeAttr(UsdGeom.Tokens.linear)
    curves.CreateWrapAttr(UsdGeom.Tokens.nonperiodic)
    curves.CreateCurveVertexCountsAttr(Vt.IntArray.FromNumpy(np.diff(limbs.first).astype(np.int32)))
    curves.CreatePointsAttr(vec3f(point))
    curves.CreateWidthsAttr(Vt.FloatArray.FromNumpy(width.astype(np.float32)))
    curves.SetWidthsInterpolation(UsdGeom.Tokens.vertex)  # linear: as many as points
    reach = np.float32(width.max() / 2)  # USD widens curves by their greatest width
    curves.CreateExtentAttr(vec3f(np.stack([point.min(axis=0) - reach, point.max(axis=0) + reach])))
    curves.CreatePurposeAttr(UsdGeom.Tokens.guide)
    level = UsdGeom.PrimvarsAPI(curves).CreatePrimvar("level", Sdf.ValueTypeNames.IntArray, UsdGeom.Tokens.uniform)
    level.Set(Vt.IntArray.FromNumpy(wind_of(tree).level.astype(np.int32)))
    return curves


def define_capsules(stage: Usd.Stage, path: Sdf.Path, capsules: Capsules) -> None:
    """Author capsules, each along its own +Y, as colliders that are not drawn: trunk_00 ..., limb_00 ..."""
    scope = UsdGeom.Scope.Define(stage, path)
    scope.CreatePurposeAttr(UsdGeom.Tokens.guide)
    count = {"trunk": 0, "limb": 0}
    for start, end, radius, limb in zip(capsules.start, capsules.end, capsules.radius, capsules.limb, strict=True):
        kind = "limb" if limb else "trunk"
        capsule = UsdGeom.Capsule.Define(stage, path.AppendChild(f"{kind}_{count[kind]:02d}"))
        count[kind] += 1
        length = float(np.linalg.norm(end - start))
        half = np.array([radius, length / 2 + radius, radius])
        capsule.CreateAxisAttr(UsdGeom.Tokens.y)
        capsule.CreateHeightAttr(length)  # without the caps
        capsule.CreateRadiusAttr(float(radius))
        capsule.CreateExtentAttr(vec3f(np.stack([-half, half])))
        capsule.CreatePurposeAttr(UsdGeom.Tokens.guide)
        capsule.AddTranslateOp().Set(Gf.Vec3d(*((start + end) / 2).tolist()))
        capsule.AddOrientOp().Set(from_up(end - start))
        UsdPhysics.CollisionAPI.Apply(capsule.GetPrim())


def from_up(direction: NDArray[np.float64]) -> Gf.Quatf:
    """The shortest turn that takes +Y to a direction (3,)."""
    x, y, z = unit(direction).tolist()
    w, *axis = (1 + y, z, 0.0, -x) if y > -1 + 1e-9 else (0.0, 1.0, 0.0, 0.0)
    return Gf.Quatf(w, *axis).GetNormalized()
