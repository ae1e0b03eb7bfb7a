"""A written tree's levels of detail as things to draw: each variant of the set LOD, chosen in the session only."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from pxr import Usd

from forestgen.errors import InputError
from forestgen.render.drawable import Drawable
from forestgen.tree.level import SCREEN_PX
from forestgen.usd.layers import open_stage
from forestgen.usd.read import stage_drawables
from forestgen.usd.variants import ALL, LOD_SET, SIZES


def read_lod_drawables(path: Path) -> Iterator[tuple[str, float, list[Drawable]]]:
    """The levels of the tree whose root layer is at `path`, the full one first: the variant's name, the height
    in pixels on the screen from which down it is drawn, and what it shows. A tree without levels is one.

    Raises:
        InputError: the file is no tree, or a layer or texture is missing or broken.
    """
    stage = open_stage(path)
    root = stage.GetDefaultPrim()
    if not root:
        raise InputError(f"{path}: has no default prim; expected the root layer of a built tree")
    heuristic = stage.GetPrimAtPath(root.GetPath().AppendChild(SIZES))
    shares = heuristic.GetAttribute("thresholds").Get() if heuristic else None
    sizes = [math.inf, *(round(SCREEN_PX * float(share), 3) for share in shares or ())]  # stored as floats
    choice = root.GetVariantSet(LOD_SET)
    names = [name for name in choice.GetVariantNames() if name != ALL] or ["LOD0"]
    if len(names) != len(sizes):
        raise InputError(f"{path}: has {len(names)} levels of detail, but sizes for {len(sizes)}: build it again")
    for name, size in zip(names, sizes, strict=True):
        if choice.HasAuthoredVariant(name):
            with Usd.EditContext(stage, stage.GetSessionLayer()):
                choice.SetVariantSelection(name)
        yield name, size, stage_drawables(stage, root.GetPath())
