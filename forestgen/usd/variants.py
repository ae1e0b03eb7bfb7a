"""Levels of detail on a root prim: a variant set that chooses one, and UsdLod for readers that choose themselves.

    variant set LOD    LOD0 (default), LOD1 ...: the other levels are inactive; `all`: every level is there,
                       the coarser ones invisible, and /<tree>/geo is a UsdLod root whose children are the levels
    /<tree>/lod_sizes  LODScreenSizeHeuristic: how large on the screen each level serves

One truth: both ways choose among the same prims below geo.
"""

from __future__ import annotations

from collections.abc import Sequence

from pxr import Sdf, Usd, UsdGeom, UsdLod, Vt

from forestgen.tree.level import SCREEN_PX
from forestgen.usd.geometry import Box, vec3f

LOD_SET, ALL = "LOD", "all"
SIZES = "lod_sizes"


def level_name(k: int) -> str:
    """LOD0 is the full tree: readers that know the set (Unreal) want these names."""
    return f"LOD{k}"


def define_lod_sizes(stage: Usd.Stage, root: Sdf.Path, switch_px: Sequence[float], box: Box) -> None:
    """Author the UsdLod root on geo and its heuristic: `switch_px` (K - 1) of the levels after the full one.

    The screen size is that of the box's bounding sphere, as a share of the screen's rows.
    """
    geo = UsdLod.RootAPI.Apply(stage.GetPrimAtPath(root.AppendChild("geo")))
    sizes = UsdLod.ScreenSizeHeuristic.Define(stage, root.AppendChild(SIZES))
    sizes.CreateLodDomainAttr(UsdLod.Tokens.imaging)
    sizes.CreateThresholdsAttr(Vt.FloatArray([float(px) / SCREEN_PX for px in switch_px]))
    sizes.CreateProjectionMethodAttr(UsdLod.Tokens.projectedExtent)
    sizes.CreateExtentAttr(vec3f(box))
    geo.CreateLodDefaultIndexAttr(0)
    geo.CreateLodHeuristicsRel().SetTargets([sizes.GetPath()])


def define_lod_variants(root: Usd.Prim, n_levels: int) -> None:
    """Author the variant set on a tree's root prim; the full level is selected."""
    choice = root.GetVariantSets().AddVariantSet(LOD_SET)
    levels = [root.GetPath().AppendPath(f"geo/{level_name(k)}") for k in range(n_levels)]
    for chosen in (*map(level_name, range(n_levels)), ALL):
        choice.AddVariant(chosen)
        choice.SetVariantSelection(chosen)
        with choice.GetVariantEditContext():
            for k, path in enumerate(levels):
                level = root.GetStage().OverridePrim(path)
                if chosen == ALL and k:
                    UsdGeom.Imageable(level).CreateVisibilityAttr(UsdGeom.Tokens.invisible)
                elif chosen not in (ALL, level_name(k)):
                    level.SetActive(False)
    choice.SetVariantSelection(level_name(0))
