"""Level: one level of detail of a tree: wood, leaves and, on the last one, cards."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.model import LeafPrototype, Leaves, Mesh, TreeModel

SCREEN_PX = 1080  # rows of the screen that switch sizes are told for

EMPTY_MESH = Mesh(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((0, 3), np.int64))
NO_LEAVES = Leaves(np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.int64))


@dataclass(frozen=True, eq=False)
class Level:
    """One level of detail, drawn where the tree is at most `switch_px` tall on a screen of SCREEN_PX rows."""

    mesh: Mesh  # wood; no faces where there is none
    leaves: Leaves  # none where cards stand for them
    prototypes: tuple[LeafPrototype, ...]  # over the tree's one leaf atlas
    cards: Mesh  # flat pieces over the card atlas; no faces but on the last level
    switch_px: float  # infinity for the full tree

    def __post_init__(self) -> None:
        if len(self.leaves) and self.leaves.prototype.max() >= len(self.prototypes):
            raise ValueError("Level.leaves points outside its prototypes")
        if not self.switch_px > 0:
            raise ValueError(f"Level.switch_px must be above 0, came {self.switch_px}")

    @property
    def n_triangles(self) -> int:
        """Triangles as drawn: each leaf counts with those of its prototype."""
        of_prototype = np.array([len(prototype.faces) for prototype in self.prototypes], np.int64)
        leaves = int(of_prototype[self.leaves.prototype].sum()) if len(self.leaves) else 0
        return len(self.mesh.faces) + len(self.cards.faces) + leaves

    @property
    def n_instances(self) -> int:
        """Leaves."""
        return len(self.leaves)


def is_coarser(level: Level, than: Level) -> bool:
    """Whether a level has fewer triangles than another, for a smaller size on the screen."""
    return level.n_triangles < than.n_triangles and level.switch_px < than.switch_px


def within(level: Level, box: NDArray[np.floating]) -> Level:
    """A level without leaves that reaches nowhere beyond a box (2, 3): what did is drawn in to its faces."""
    if len(level.leaves):
        raise ValueError("a level with leaves cannot be drawn in")

    def drawn_in(mesh: Mesh) -> Mesh:
        points = np.clip(mesh.points, box[0], box[1])
        corner = points[mesh.faces].astype(np.float32)  # as stored
        across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        return replace(mesh, points=points, faces=mesh.faces[(across != 0).any(axis=1)])

    return replace(level, mesh=drawn_in(level.mesh), cards=drawn_in(level.cards))


def full_level(model: TreeModel) -> Level:
    """The tree itself."""
    return Level(model.mesh, model.leaves, model.atlas.prototypes, EMPTY_MESH, math.inf)
