"""Dressing: the pictures that a tree wears in each season, and what each season changes in its asset.

A season's pictures are those of the leaves, of the cards, and of the six sides of the tree's box (drawMode).
Their names are those of the tree as photographed with an ending: leaf_autumn, leaf_cards_winter.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import stage_rng
from forestgen.render.cards import CardPlan, bake_cards, plan_cards
from forestgen.render.side_cards import side_cards
from forestgen.tree.delight import delit
from forestgen.tree.level import Level, full_level, is_coarser, within
from forestgen.tree.model import TreeModel
from forestgen.tree.seasons import Season, fallen, season_atlas, seasons_of
from forestgen.usd.card_textures import AXES, card_name
from forestgen.usd.extras import CARDS, LEAF, picture_path
from forestgen.usd.geometry import level_box, union
from forestgen.usd.seasons import SeasonLook
from forestgen.usd.tree_layers import DELIT
from forestgen.usd.variants import level_name

Pictures = dict[str, NDArray[np.uint8]]


def dress(
    model: TreeModel, finer: Sequence[Level], *, without_light: bool = False
) -> tuple[tuple[Level, ...], Pictures, dict[Season, SeasonLook]]:
    """Cards as the last level of a tree with coarser levels `finer`, where they are worth it; pictures; seasons.

    The leaf atlas as photographed is the model's own and not among the pictures. Where `without_light`, leaves and
    cards have a second picture. Cards reach nowhere beyond the other levels, so that the sides of the tree's box are
    drawn while the cards are laid out.
    """
    every = [full_level(model), *finer]
    worn: dict[Season, NDArray[np.uint8] | None] = {}  # leaf atlases of the seasons that differ; None is bare
    gone: dict[Season, dict[str, NDArray[np.int64]]] = {}
    for season in seasons_of(model):
        is_bare = season == "winter" and not model.evergreen
        rng = stage_rng(model.seed, "seasons", season)
        leaf = None
        if len(model.leaves) and not is_bare:
            leaf = season_atlas(model.atlas, season, evergreen=model.evergreen, rng=rng)
        gone[season] = {
            level_name(k): fallen(level.leaves, season, evergreen=model.evergreen, rng=rng)
            for k, level in enumerate(every)
            if len(level.leaves) and not is_bare
        }
        if season == "photo" or not _is_as_photographed(model, leaf):
            worn[season] = leaf
    last, drawn = draw_pictures(model, every, list(worn.values()), without_light)
    made = dict(zip(worn, drawn, strict=True))
    pictures: Pictures = {}
    looks: dict[Season, SeasonLook] = {}
    for season, fallen_leaves in gone.items():
        ending = "" if season == "photo" else f"_{season}"
        own = made.get(season, {})
        pictures |= {name + ending: image for name, image in own.items()}
        is_bare = season == "winter" and not model.evergreen
        looks[season] = season_look(own, ending, fallen_leaves, is_bare, without_light) if ending else SeasonLook()
    pictures.pop(LEAF, None)
    return last, pictures, looks


def _is_as_photographed(model: TreeModel, leaf: NDArray[np.uint8] | None) -> bool:
    """Whether a tree with this leaf atlas (none where it is bare) looks as in its photo."""
    return np.array_equal(leaf, model.atlas.rgba) if leaf is not None else not len(model.leaves)


def draw_pictures(
    model: TreeModel, every: Sequence[Level], worn: Sequence[NDArray[np.uint8] | None], without_light: bool
) -> tuple[tuple[Level, ...], list[Pictures]]:
    """The level of cards that follows `every` level, if any, and what the tree wears with each of some leaf atlases.

    Atlases are (H, W, 4), None where it is bare. The first one is the tree's own; cards of the same leaves in other
    colours share its cards' alpha. The sides of the box around all levels are drawn from the first coarser one,
    which is meant for their size.
    """
    shown = _as_level(model, every[min(1, len(every) - 1)])
    box = union([level_box(level) for level in every])
    leafy = [leaf for leaf in worn if leaf is not None]
    with ThreadPoolExecutor(2) as aside:  # most of it runs without Python's lock
        sides = aside.submit(side_cards, shown, box, worn)
        laid_out = plan_cards(model)
        cards = within(laid_out.level(model), box)
        plan = laid_out if len(cards.cards.faces) and is_coarser(cards, every[-1]) else None
        bare = aside.submit(_bare_pictures, model, plan if len(leafy) < len(worn) else None)
        dressed = iter(_leafy_pictures(model, plan, leafy, without_light))
        made = [dict(bare.result()) if leaf is None else next(dressed) for leaf in worn]
    for pictures, faces in zip(made, sides.result(), strict=True):
        pictures |= {card_name(face): image for face, image in faces.items()}
    return (() if plan is None else (cards,)), made


def _bare_pictures(model: TreeModel, plan: CardPlan | None) -> Pictures:
    """Cards of bare wood."""
    return {} if plan is None else {CARDS: bake_cards(plan, model, None)}


def _leafy_pictures(
    model: TreeModel, plan: CardPlan | None, worn: Sequence[NDArray[np.uint8]], without_light: bool
) -> list[Pictures]:
    """Leaves and cards with each of some leaf atlases."""
    made: list[Pictures] = []
    for leaf in worn:
        pictures: Pictures = {LEAF: leaf}
        if plan is not None:
            pictures[CARDS] = bake_cards(plan, model, leaf, alpha=_alpha(made[0][CARDS]) if made else None)
        if without_light:
            pictures[LEAF + DELIT] = delit(replace(model.atlas, rgba=leaf))
            if plan is not None:
                pictures[CARDS + DELIT] = bake_cards(plan, model, pictures[LEAF + DELIT], alpha=_alpha(pictures[CARDS]))
        made.append(pictures)
    return made


def _alpha(rgba: NDArray[np.uint8]) -> NDArray[np.float32]:
    return rgba[..., 3].astype(np.float32) / np.float32(255)


def _as_level(model: TreeModel, level: Level) -> TreeModel:
    """The tree with a level's wood and leaves for its own."""
    atlas = replace(model.atlas, prototypes=level.prototypes)
    return replace(model, mesh=level.mesh, leaves=level.leaves, atlas=atlas)


def season_look(
    made: Collection[str], ending: str, gone: dict[str, NDArray[np.int64]], is_bare: bool, without_light: bool
) -> SeasonLook:
    """What a season changes: pictures `made` for it, by their names without its `ending`, and leaves gone by level.

    Cards of bare wood are the same without the photo's light.
    """
    foliage = [name for name in (LEAF, CARDS) if name in made]
    lit = foliage if without_light else []
    return SeasonLook(
        pictures={name: picture_path(name + ending) for name in foliage},
        delit={name: picture_path((name + DELIT if name + DELIT in made else name) + ending) for name in lit},
        fallen={} if is_bare else gone,
        is_bare=is_bare,
        attributes={
            f"model:cardTexture{face}": picture_path(card_name(face) + ending)
            for face in AXES
            if card_name(face) in made
        },
    )
