"""A crown ready to be thinned out: its leaves in the order in which levels leave them out, and what they wear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.lod_leaves import LeafOrder, fewer, leaf_order, turned
from forestgen.tree.lod_outline import outline_weight
from forestgen.tree.lod_prototypes import covered_area, simpler
from forestgen.tree.model import LeafPrototype, Leaves, TreeModel

LUMA = np.array([0.299, 0.587, 0.114])  # how bright a colour looks


@dataclass(frozen=True, eq=False)
class Crown:
    """The leaves of one tree for levels of detail. L leaves, K prototypes."""

    leaves: Leaves
    order: LeafOrder
    prototypes: tuple[LeafPrototype, ...]  # K, those of the tree itself
    area: NDArray[np.float64]  # (K,) opaque area of each, in squares of its length

    def __post_init__(self) -> None:
        freeze(self, area=(np.float64, "K"))

    def count(self, density: float) -> int:
        """How many leaves stay at a density; one at least, where there are any."""
        return max(int(np.searchsorted(self.order.due, density)), min(1, len(self.leaves)))

    def density(self, count: int) -> float:
        """The density at which so many leaves stay; 1 for all."""
        return float(min(1.0, self.order.due[count])) if count < len(self.leaves) else 1.0

    def dressed(self, count: int, triangles: int, rgba: NDArray[np.uint8]) -> tuple[Leaves, tuple[LeafPrototype, ...]]:
        """The first `count` leaves, grown to the area of all, and their prototypes of at most so many triangles."""
        new = tuple(simpler(prototype, triangles) for prototype in self.prototypes)
        if not len(self.leaves):
            return self.leaves, new
        area = np.array([covered_area(prototype, rgba) for prototype in new])
        ratio = np.where((self.area > 0) & (area > 0), area / np.maximum(self.area, 1e-12), 1.0)
        if count == len(self.leaves) and new == self.prototypes:
            return self.leaves, new
        middle = _middles(new)
        of = self.leaves.prototype
        return fewer(self.leaves, self.order, count, self.area[of], ratio[of], middle[of]), new


def crown_of(model: TreeModel) -> Crown:
    """The order in which a tree's leaves are left out; the same for each of its levels."""
    leaves, prototypes = model.leaves, model.atlas.prototypes
    area = np.array([covered_area(prototype, model.atlas.rgba) for prototype in prototypes])
    if not len(leaves):
        none = LeafOrder(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
        return Crown(leaves, none, prototypes, area)
    of = leaves.prototype
    at = leaves.position + leaves.size[:, None] * turned(leaves.orientation, _middles(prototypes)[of])
    shade = np.array([prototype.colour @ LUMA for prototype in prototypes])
    return Crown(leaves, leaf_order(at, shade[of], outline_weight(at)), prototypes, area)


def _middles(prototypes: tuple[LeafPrototype, ...]) -> NDArray[np.float64]:
    """The middle (K, 3) of each prototype, in leaf space."""
    return np.array([prototype.points.mean(axis=0) for prototype in prototypes])
