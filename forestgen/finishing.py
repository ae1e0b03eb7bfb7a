"""Finishing: what an asset holds beside the tree: coarser levels, cards, seasons, looks, wind data, guides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from forestgen.errors import InputError
from forestgen.tree.level import Level, full_level, is_coarser
from forestgen.tree.model import TreeModel

if TYPE_CHECKING:
    from forestgen.usd.extras import Extras


@dataclass(frozen=True)
class Finish:
    """What a tree's asset holds only where it is asked for.

    Raises:
        InputError: leaves without the photo's light are asked for on a tree without the pictures that come with them.
    """

    delit: bool = False  # variant set `light`: leaves without the photo's light
    openpbr: bool = False  # variant set `look`: validators that know no MaterialX report its nodes as unknown
    plain: bool = False  # no levels of detail, cards, seasons: the tree with wind data and guides, in less time

    def __post_init__(self) -> None:
        if self.plain and self.delit:
            raise InputError("--plain leaves out the pictures that --delit asks for: give one of them")


def finish(model: TreeModel, wanted: Finish | None = None) -> Extras:
    """All that goes into a tree's asset beside the tree. It needs no OpenGL."""
    from forestgen.dressing import dress
    from forestgen.tree.lod import LOD_STEPS, coarser_level
    from forestgen.usd.extras import Extras

    wanted = wanted or Finish()
    if wanted.plain:
        return Extras(openpbr=wanted.openpbr, wind=True, guides=True)
    finer = coarsening(model, [coarser_level(model, step) for step in LOD_STEPS])
    last, pictures, seasons = dress(model, finer, without_light=wanted.delit)
    return Extras((*finer, *last), pictures, seasons, openpbr=wanted.openpbr, wind=True, guides=True)


def coarsening(model: TreeModel, levels: Sequence[Level]) -> tuple[Level, ...]:
    """Those of some levels that have fewer triangles, for a smaller size on the screen, than the one before."""
    kept = [full_level(model)]
    for level in levels:
        if is_coarser(level, kept[-1]):
            kept.append(level)
    return tuple(kept[1:])
