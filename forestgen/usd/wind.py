"""Wind data as primvars: a layer of overs on every level of a tree, for shaders that bend its branches.

    geo                        primvars:wind:limbs:*   tables of the limbs, inherited by all below
    geo/LOD<k>/branches, ...   primvars:wind:*         one value a point or leaf, that of its limb; and its limb

docs/wind.md says what they mean.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, UsdGeom, Vt

from forestgen.tree.level import Level
from forestgen.tree.limb_tree import limb_tree
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.wind import Wind, limb_of_leaves, limb_of_mesh, wind_of
from forestgen.usd.geometry import vec3f
from forestgen.usd.layers import new_stage
from forestgen.usd.seams import weld

LAYER = "wind.usdc"


def wind_layer(name: str, skeleton: Skeleton, levels: Sequence[Level]) -> Sdf.Layer:
    """The wind primvars of a tree's levels as overs on /<name>/geo and its LOD<k>. Cards swing with the trunk.

    Raises:
        ValueError: a radius of the skeleton is NaN or negative.
    """
    tree = limb_tree(skeleton)
    wind = wind_of(tree)
    stage = new_stage(name)
    geo = Sdf.Path(f"/{name}/geo")
    author_tables(UsdGeom.PrimvarsAPI(stage.OverridePrim(geo)), wind)
    for k, level in enumerate(levels):
        home = geo.AppendChild(f"LOD{k}")
        parts: dict[str, NDArray[np.int64]] = {}
        if len(level.mesh.faces):
            parts["branches"] = limb_of_mesh(level.mesh, tree)[weld(level.mesh).kept]
        if len(level.leaves):
            parts["leaves"] = limb_of_leaves(level.leaves, tree)
        if len(level.cards.faces):
            parts["leaf_cards"] = np.zeros(len(weld(level.cards).kept), np.int64)
        for part, limb in parts.items():
            author_values(UsdGeom.PrimvarsAPI(stage.OverridePrim(home.AppendChild(part))), wind, limb)
    return stage.GetRootLayer()


def author_tables(api: UsdGeom.PrimvarsAPI, wind: Wind) -> None:
    """Author the values (L,) of all limbs as constant primvars of L elements: what shaders look parents up in."""
    kinds = Sdf.ValueTypeNames
    tables = {
        "parent": (kinds.IntArray, _ints(wind.parent)),
        "pivot": (kinds.Point3fArray, vec3f(wind.pivot)),
        "axis": (kinds.Vector3fArray, vec3f(wind.axis)),
        "level": (kinds.IntArray, _ints(wind.level)),
        "phase": (kinds.FloatArray, _floats(wind.phase)),
        "stiffness": (kinds.FloatArray, _floats(wind.stiffness)),
    }
    for key, (kind, value) in tables.items():
        api.CreatePrimvar(f"wind:limbs:{key}", kind, UsdGeom.Tokens.constant, len(wind)).Set(value)


def author_values(api: UsdGeom.PrimvarsAPI, wind: Wind, limb: NDArray[np.int64]) -> None:
    """Author one value a point or instance (P,), that of its limb (P,).

    `vertex` on a point instancer means one an instance (UsdGeomPointInstancer, "Primvars"). Values are
    stored once a limb that occurs, with an index; crate stores equal indices once. Phases and stiffnesses
    repeat, and have shorter lists of their own.
    """
    kinds, vertex = Sdf.ValueTypeNames, UsdGeom.Tokens.vertex
    used, of_point = np.unique(limb, return_inverse=True)
    for key, kind, values in (
        ("pivot", kinds.Point3fArray, wind.pivot),
        ("axis", kinds.Vector3fArray, wind.axis),
        ("phase", kinds.FloatArray, wind.phase),
        ("stiffness", kinds.FloatArray, wind.stiffness),
    ):
        first, index = _distinct(values[used].astype(np.float32))
        stored = values[used[first]]
        primvar = api.CreatePrimvar(f"wind:{key}", kind, vertex)
        primvar.Set(vec3f(stored) if stored.ndim == 2 else _floats(stored))
        primvar.SetIndices(_ints(index[of_point]))
    for key, numbers in (("level", wind.level[used]), ("limb", used)):
        primvar = api.CreatePrimvar(f"wind:{key}", kinds.IntArray, vertex)
        primvar.Set(_ints(numbers))
        primvar.SetIndices(_ints(of_point))


def _distinct(values: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where each distinct one of values (U, ...) comes first (D,), rising, and which of them each value is (U,)."""
    _, first, index = np.unique(values, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return first[order], np.argsort(order)[index]


def _ints(array: NDArray[np.int64]) -> Vt.IntArray:
    return Vt.IntArray.FromNumpy(np.ascontiguousarray(array, np.int32))


def _floats(array: NDArray[np.float64]) -> Vt.FloatArray:
    return Vt.FloatArray.FromNumpy(np.ascontiguousarray(array, np.float32))
