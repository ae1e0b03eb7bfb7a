"""Finishing: what an asset holds beside the tree: coarser levels of detail, cards, wind data, guides."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forestgen.errors import RenderError
from forestgen.tree.extras import NO_CARDS, Extras
from forestgen.tree.level import Level, full_level
from forestgen.tree.model import TreeModel


def finish(model: TreeModel) -> Extras:
    """All that goes into a tree's asset beside the tree.

    Cards are drawn: without OpenGL there are none, and the user is told.
    """
    return dress(model, *make_levels(model))


def dress(
    model: TreeModel, levels: tuple[Level, ...], card_atlas: NDArray[np.uint8] | None, notes: tuple[str, ...] = ()
) -> Extras:
    """All that goes into the asset of a tree with these levels after the full one, and the picture on its cards."""
    atlas = NO_CARDS if card_atlas is None else card_atlas
    return Extras(levels=levels, card_atlas=atlas, wind=True, guides=True, notes=notes)


def make_levels(model: TreeModel) -> tuple[tuple[Level, ...], NDArray[np.uint8] | None, tuple[str, ...]]:
    """The levels after the full one, the picture (H, W, 4) on the cards of the last where it has some, and notes.

    A level that is no coarser than the one before is left out: a small tree needs fewer.
    """
    from forestgen.render.cards import bake_cards, plan_cards
    from forestgen.tree.lod import LOD_STEPS, coarser_level

    levels = [coarser_level(model, step) for step in LOD_STEPS]
    atlas = None
    notes: tuple[str, ...] = ()
    plan = plan_cards(model)
    if len(plan.mesh.faces):
        try:
            atlas = bake_cards(plan, model, model.atlas.rgba)
            levels.append(plan.level(model))
        except RenderError as error:
            notes = (f"no level of cards: {error}",)
    return coarsening(model, levels), atlas, notes


def coarsening(model: TreeModel, levels: Sequence[Level]) -> tuple[Level, ...]:
    """Those of some levels that have fewer triangles, for a smaller size on the screen, than the one before."""
    kept = [full_level(model)]
    for level in levels:
        if level.n_triangles < kept[-1].n_triangles and level.switch_px < kept[-1].switch_px:
            kept.append(level)
    return tuple(kept[1:])
