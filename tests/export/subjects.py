"""Trees to export: small ones of known numbers, with levels and cards."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.level import EMPTY_MESH, NO_LEAVES, Level, full_level
from forestgen.tree.model import Leaves, Mesh, TreeModel
from tests.usd.models import box_mesh, tree_model

CARD_RGBA: NDArray[np.uint8] = np.full((8, 8, 4), 200, np.uint8)


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


def oak() -> TreeModel:
    """A box for a trunk and 50 leaves of three kinds."""
    return tree_model()
