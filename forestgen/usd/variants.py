"""Levels of detail on a root prim: a variant set that chooses one, and UsdLod for readers that choose themselves.

    variant set LOD    LOD0 (default), LOD1 ...: the other levels are inactive; `all`: every level is there,
                       the coarser ones invisible, and /<tree>/geo is a UsdLod root whose children are the levels
    /<tree>/lod_sizes  LODScreenSizeHeuristic: how large on the screen each level serves

One truth: both ways choose among the same prims below geo.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pxr import Sdf, Usd, UsdGeom, UsdLod, Vt

from forestgen.errors import InputError
from forestgen.tree.level import SCREEN_PX
from forestgen.usd.geometry import Box, vec3f

LOD_SET, ALL = "LOD", "all"
SIZES = "lod_sizes"


def level_name(k: int) -> str:
    """LOD0 is the full tree: readers that know the set (Unreal) want these names."""
    return f"LOD{k}"


def variant_sets(path: Path) -> list[str]:
    """The names of the variant sets on the default prim of a tree's root layer, from that layer alone.

    Raises:
        InputError: it cannot be read.
    """
    layer = Sdf.Layer.OpenAsAnonymous(str(path)) if path.is_file() else None
    if layer is None:
        raise InputError(f"{path}: cannot be read; expected the root layer of a built tree: build it again")
    sets = layer.GetPrimAtPath(f"/{layer.defaultPrim}").variantSets
    return [str(name) for name in sets.keys()]  # noqa: SIM118 - by itself it gives values


def define_lod_sizes(stage: Usd.Stage, root: Sdf.Path, switch_px: Sequence[float], box: Box) -> None:
    """Author the heuristic that chooses a level: `switch_px` (K - 1) of the levels after the full one.

    The size on the screen is that of the tree's box (2, 3), as a share of the screen.
    """
    sizes = UsdLod.ScreenSizeHeuristic.Define(stage, root.AppendChild(SIZES))
    sizes.CreateLodDomainAttr(UsdLod.Tokens.imaging)
    sizes.CreateThresholdsAttr(Vt.FloatArray([float(px) / SCREEN_PX for px in switch_px]))
    sizes.CreateProjectionMethodAttr(UsdLod.Tokens.projectedExtent)
    sizes.CreateExtentAttr(vec3f(box))


def define_lod_variants(root: Usd.Prim, n_levels: int) -> None:
    """Author the variant set on a tree's root prim; the full level is selected.

    geo is a UsdLod root in `all` only: where other levels are inactive, its children are not the levels.
    """
    stage, geo = root.GetStage(), root.GetPath().AppendChild("geo")
    levels = [geo.AppendChild(level_name(k)) for k in range(n_levels)]
    choice = root.GetVariantSets().AddVariantSet(LOD_SET)
    for k in range(n_levels):
        choice.AddVariant(level_name(k))
        choice.SetVariantSelection(level_name(k))
        with choice.GetVariantEditContext():
            for path in (*levels[:k], *levels[k + 1 :]):
                stage.OverridePrim(path).SetActive(False)
    choice.AddVariant(ALL)
    choice.SetVariantSelection(ALL)
    with choice.GetVariantEditContext():
        for path in levels[1:]:
            UsdGeom.Imageable(stage.OverridePrim(path)).CreateVisibilityAttr(UsdGeom.Tokens.invisible)
        lod = UsdLod.RootAPI.Apply(stage.OverridePrim(geo))
        lod.CreateLodDefaultIndexAttr(0)
        lod.CreateLodHeuristicsRel().SetTargets([root.GetPath().AppendChild(SIZES)])
    choice.SetVariantSelection(level_name(0))
