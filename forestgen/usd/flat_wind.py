"""Wind data of what is flattened: what was said of each instance is said of each of its points, by the same names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from forestgen.render.drawable import Drawable
from forestgen.tree.model import Mesh
from forestgen.tree.wind import Wind
from forestgen.usd.composed import Part
from forestgen.usd.polygons import read_triangles
from forestgen.usd.seams import weld
from forestgen.usd.wind import author_tables, author_values


def author_flat_wind(prim: Usd.Prim, mesh: Mesh, parts: Sequence[Part], geo: Usd.Prim) -> None:
    """Author the wind data of a tree's parts, joined as `mesh`, on the mesh that was written of it.

    The tables come from the tree's own `geo`; where that has none nothing is authored.
    """
    wind = read_wind(geo)
    if wind is None:
        return
    limb = np.concatenate([limbs_of(geo.GetStage(), drawable) for part in parts for drawable in part.drawables])
    api = UsdGeom.PrimvarsAPI(prim)
    author_tables(api, wind)
    author_values(api, wind, limb[weld(mesh).kept])


def read_wind(geo: Usd.Prim) -> Wind | None:
    """The tables of a tree's limbs; None where it was written without."""
    names = [f"wind:limbs:{name}" for name in ("pivot", "axis", "level", "phase", "stiffness", "parent")]
    api = UsdGeom.PrimvarsAPI(geo)
    if not geo or not all(api.HasPrimvar(name) for name in names):
        return None
    return Wind(*(np.array(api.GetPrimvar(name).Get()) for name in names))


def limbs_of(stage: Usd.Stage, drawable: Drawable) -> NDArray[np.int64]:
    """The limb (K P,) of each point of a tree's drawable in each of its K places, in the order of `flattened`."""
    prim = stage.GetPrimAtPath(drawable.name)
    above = prim.GetParent()
    while above and not above.IsA(UsdGeom.PointInstancer):
        above = above.GetParent()
    if not above:
        triangles = read_triangles(prim, Usd.TimeCode.Default())
        assert triangles is not None  # it was drawn
        return np.tile(_limbs(prim)[triangles.stored], len(drawable.transforms))
    instancer = UsdGeom.PointInstancer(above)
    own = list(instancer.GetPrototypesRel().GetForwardedTargets()).index(prim.GetPath())
    is_own = np.array(instancer.GetProtoIndicesAttr().Get()) == own
    mask = np.array(instancer.ComputeMaskAtTime(Usd.TimeCode.Default()), bool)
    return np.repeat(_limbs(above)[is_own & mask if len(mask) else is_own], len(drawable.points))


def _limbs(prim: Usd.Prim) -> NDArray[np.int64]:
    return np.array(UsdGeom.PrimvarsAPI(prim).GetPrimvar("wind:limb").ComputeFlattened(), np.int64)
