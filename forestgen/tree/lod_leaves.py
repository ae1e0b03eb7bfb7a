"""Fewer, larger leaves that look like all of them: a fixed order in which a crown's leaves can be left out.

After Cook, Halstead, Planck and Ryu 2007, "Stochastic simplification of aggregate detail": every leaf has a
fixed place in one order, a level keeps the order's first leaves, and those grow so that the total area stays.
Where the paper draws the order at random, ours is even in space and colour (a space-filling curve dealt out by
bit reversal), so that no region thins out or changes colour by chance. The paper also takes contrast off, since
fewer elements in a pixel differ more; ours do not share a pixel where a level is used, and keep their colours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.lod_order import bit_reversed, morton
from forestgen.tree.model import Leaves

CELL_LEAVES = 32  # leaves of a region within which colours are kept in proportion


@dataclass(frozen=True, eq=False)
class LeafOrder:
    """Which leaves a level of any number of them keeps. L leaves."""

    order: NDArray[np.int64]  # (L,) leaves, the ones that stay longest first
    due: NDArray[np.float64]  # (L,) in that order: the density up to which a level does without the leaf
    weight: NDArray[np.float64]  # (L,) by leaf: chance to stay, over that of others

    def __post_init__(self) -> None:
        freeze(self, order=(np.int64, "L"), due=(np.float64, "L"), weight=(np.float64, "L"))

    def __len__(self) -> int:
        return len(self.order)


def leaf_order(position: NDArray[np.float64], shade: NDArray[np.float64], weight: NDArray[np.float64]) -> LeafOrder:
    """The order of leaves at (L, 3), as bright as `shade` (L,); those of greater weight (L,) > 0 stay longer."""
    n = len(position)
    along = np.lexsort((shade, morton(position, np.log2(max(n / CELL_LEAVES, 1)) / 3)))
    lot = np.empty(n)
    lot[along] = bit_reversed(n)
    due = lot / weight
    order = np.argsort(due, kind="stable")
    return LeafOrder(order, due[order], weight)


def fewer(
    leaves: Leaves,
    order: LeafOrder,
    count: int,
    area: NDArray[np.float64],
    ratio: NDArray[np.float64],
    middle: NDArray[np.float64],
) -> Leaves:
    """The first `count` leaves of the order, grown to the area of all.

    Args:
        leaves: all of them.
        order: theirs.
        count: how many to keep, 1 to L.
        area: (L,) of a leaf one metre long, m2.
        ratio: (L,) of the area of its new prototype to that of the old one.
        middle: (L, 3) point in leaf space that stays where it is when the leaf grows.
    """
    kept = np.sort(order.order[:count])
    density = order.due[count] if count < len(order) else np.inf
    share = np.minimum(1.0, np.maximum(density, 1e-12) * order.weight[kept])
    all_of_it = leaves.size**2 * area
    wanted = all_of_it[kept] / share
    grown = all_of_it.sum() / wanted.sum() / (share * ratio[kept])
    size = leaves.size[kept] * np.sqrt(grown)
    step = (leaves.size[kept] - size)[:, None] * turned(leaves.orientation[kept], middle[kept])
    return Leaves(leaves.position[kept] + step, leaves.orientation[kept], size, leaves.prototype[kept])


def turned(orientation: NDArray[np.float64], vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (L, 3) turned by unit quaternions (L, 4) w x y z."""
    axis = orientation[:, 1:]
    twice = 2 * np.cross(axis, vector)
    return np.asarray(vector + orientation[:, :1] * twice + np.cross(axis, twice))
