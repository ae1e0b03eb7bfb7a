"""Trees to export: small ones of known numbers, with levels and cards."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forestgen.export.subject import Subject
from forestgen.reference import write_provenance
from forestgen.tree.level import EMPTY_MESH, NO_LEAVES, Level, full_level
from forestgen.tree.model import Leaves, Mesh, TreeModel
from forestgen.usd.extras import CARDS, Extras
from forestgen.usd.read_model import read_card_atlas, read_levels, read_model
from forestgen.usd.tree_asset import write_tree_asset
from tests.usd.models import box_mesh, random_leaves, tree_model

CARD_RGBA: NDArray[np.uint8] = np.array([[[90, 120, 60, 255], [70, 90, 40, 0]]], np.uint8).repeat(8, 0).repeat(4, 1)


def levels_of(model: TreeModel) -> tuple[Level, ...]:
    """The tree itself, a coarser one with every other leaf, and a card."""
    half = Leaves(*(getattr(model.leaves, name)[::2] for name in ("position", "orientation", "size", "prototype")))
    coarse = Level(box_mesh(0.25, 2.0), half, model.atlas.prototypes, EMPTY_MESH, 270.0)
    cards = Level(EMPTY_MESH, NO_LEAVES, (), card(), 54.0)
    return full_level(model), coarse, cards


def card() -> Mesh:
    """A square of 2 m."""
    corner = np.array([[-1.0, 0, 0], [1, 0, 0], [1, 2, 0], [-1, 2, 0]])
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    return Mesh(corner, np.tile([0.0, 0, 1], (4, 1)), uv, np.array([[0, 1, 2], [0, 2, 3]]))


def without_atlas(model: TreeModel) -> TreeModel:
    """A tree whose leaves have lost their picture."""
    return replace(model, atlas=replace(model.atlas, rgba=np.zeros((1, 1, 4), np.uint8)))


def broken(model: TreeModel) -> TreeModel:
    """A tree with a point that is nowhere."""
    points = model.mesh.points.copy()
    points[3, 1] = math.nan
    return replace(model, mesh=replace(model.mesh, points=points))


def leafy_oak() -> TreeModel:
    """A box for a trunk under 60 large leaves, whose pictures are cut out in the middle of each column."""
    rng = np.random.default_rng(11)
    leaves = replace(random_leaves(60, 3, rng), size=rng.uniform(0.4, 0.7, 60))
    return replace(tree_model(leaves=leaves), atlas=replace(oak().atlas, rgba=leaf_rgba()))


def leaf_rgba() -> NDArray[np.uint8]:
    """Three columns of a colour each, cut out by a disc with a hole, on a width that is a power of two."""
    y, x = np.mgrid[:128, :256]
    column = 256 / 3
    from_middle = np.hypot((x % column - 42) / 40, (y - 60) / 60)
    rgba = np.zeros((128, 256, 4), np.uint8)
    rgba[..., :3] = np.array([[60, 140, 40], [150, 170, 50], [200, 90, 30]], np.uint8)[
        np.minimum(x // column, 2).astype(int)
    ]
    rgba[..., 3] = np.where((from_middle < 1) & (from_middle > 0.25), 255, 0)
    return rgba


def leafy_levels() -> tuple[Level, ...]:
    return levels_of(leafy_oak())


def oak() -> TreeModel:
    """A box for a trunk and 50 leaves of three kinds."""
    return tree_model()


def write_tree(model: TreeModel, folder: Path) -> Path:
    """Write a tree with its three levels as a build does; give its folder."""
    write_tree_asset(model, folder, Extras(levels_of(model)[1:], {CARDS: CARD_RGBA}))
    write_provenance(model, folder / "reference")
    return folder


def read_subject(folder: Path) -> Subject:
    """A written tree, ready to be exported."""
    return Subject(read_model(folder), read_levels(folder), read_card_atlas(folder))
