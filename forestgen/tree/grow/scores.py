"""Scores: what each placement of a subtree would gain, without measuring anything twice.

A placement's own distances to the attractors never change and the tree's only fall. So a placement
stores, once, the attractors that it brings nearer (sparse), and its gain at any later time is a sum
over these: exactly what measuring afresh would give (Tan et al. 2008, "Speedup", taken one step further).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow import kernels
from forestgen.tree.grow.attractors import Field, picture_plane
from forestgen.tree.grow.crown_volume import CrownVolume
from forestgen.tree.grow.placement import Patterns, Placements, patterns, place
from forestgen.tree.grow.subtree_library import Subtree

Sparse = tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float64]]

MAX_STORE_BYTES = 96_000_000  # of stored placements; the branch drawn longest ago is forgotten, and measured again


@dataclass(eq=False)
class Block:
    """All placements on one axis: C of them, M segments that the silhouettes left."""

    a: NDArray[np.float64]  # (M, 3) m
    b: NDArray[np.float64]  # (M, 3) m
    group: NDArray[np.int64]  # (M,) branch
    start: NDArray[np.int64]  # (C + 1,)
    image: list[Sparse]  # a view
    space: list[Sparse] = field(default_factory=list)  # one for each time that attractors were added
    n_space: int = 0  # attractors in space that were looked at

    @property
    def n_bytes(self) -> int:
        sparse = [part for one in (*self.image, *self.space) for part in one]
        return sum(array.nbytes for array in (self.a, self.b, self.group, self.start, *sparse))


@dataclass(frozen=True, eq=False)
class PlacementRules:
    """Which placements there are on a branch; lengths in metres."""

    library: tuple[Subtree, ...]
    n_rotations: int
    volume: CrownVolume
    share: float  # of a new branch's length that pruning must leave
    shortest: float  # new branch

    @cached_property
    def for_trunk(self) -> Patterns:
        return patterns([subtree for subtree in self.library if subtree.on != "side"], self.n_rotations)

    @cached_property
    def for_sides(self) -> Patterns:
        return patterns([subtree for subtree in self.library if subtree.on != "trunk"], self.n_rotations)

    def placements(
        self, line: NDArray[np.float64], order: int, which: int | None = None
    ) -> tuple[Placements, NDArray[np.bool_]]:
        """All placements on a branch (P, 3) of an order, or one, and which nodes (M,) the silhouettes leave."""
        wanted = self.for_trunk if order == 0 else self.for_sides
        placed = place(line, wanted if which is None else wanted.only(which))
        may_pass, may_end = self.volume.allows(placed.position)
        may_pass &= ~self.volume.is_skin(placed.position)
        return placed, self.prune(placed, may_pass & self.volume.spans(placed.before, placed.position), may_end)

    def prune(self, placed: Placements, may_pass: NDArray[np.bool_], may_end: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Which nodes (M,) stay, see `kernels.prune`."""
        return np.asarray(
            kernels.prune(placed.parent, placed.group, placed.length, may_pass, may_end, self.share, self.shortest)
        )


class Scores:
    """Gains of placements over image attractors (one field a view) and attractors in space."""

    def __init__(
        self, rules: PlacementRules, image: Sequence[Field], space: Field, max_bytes: int = MAX_STORE_BYTES
    ) -> None:
        self.rules, self.image, self.space, self.max_bytes = rules, image, space, max_bytes
        self._blocks: dict[int, Block] = {}  # by axis, the one drawn last at the end
        self.n_bytes = 0  # that the blocks take

    def cost(self, kind: str) -> float:
        """E2D or E3D of the tree as it stands, metres."""
        return self.space.cost if kind == "space" else sum(one.cost for one in self.image)

    def gains(self, axis: int, line: NDArray[np.float64], order: int, kind: str) -> NDArray[np.float64]:
        """By how much each placement (C,) on an axis of an order would lower the cost."""
        block = self._blocks.pop(axis, None)
        if block is None:
            block = self._measure(line, order)
            self.n_bytes += block.n_bytes
        self._blocks[axis] = block
        if kind == "image":
            parts = [kernels.gains(*s, one.distance) for s, one in zip(block.image, self.image, strict=True)]
            return np.asarray(np.sum(parts, axis=0))
        if block.n_space < len(self.space):
            new = kernels.improvements(
                block.a, block.b, block.group, block.start, self.space.point, self.space.distance, block.n_space
            )
            block.space.append(new)
            block.n_space = len(self.space)
            self.n_bytes += sum(part.nbytes for part in new)
            self._forget()
        return np.asarray(np.sum([kernels.gains(*s, self.space.distance) for s in block.space], axis=0))

    def grow(self, a: NDArray[np.float64], b: NDArray[np.float64]) -> None:
        """The tree has got new segments (M, 3), (M, 3)."""
        self.space.grow(a, b)
        for camera, one in zip(self.rules.volume.cameras, self.image, strict=True):
            one.grow(picture_plane(camera, a), picture_plane(camera, b))

    def _measure(self, line: NDArray[np.float64], order: int) -> Block:
        placed, stays = self.rules.placements(line, order)
        count = np.concatenate([[0], np.cumsum(stays)])
        a, b = placed.before[stays], placed.position[stays]
        group, start = placed.group[stays], count[placed.start]
        image = [
            kernels.improvements(
                picture_plane(camera, a), picture_plane(camera, b), group, start, one.point, one.distance, 0
            )
            for camera, one in zip(self.rules.volume.cameras, self.image, strict=True)
        ]
        return Block(a, b, group, start, image)

    def _forget(self) -> None:
        while self.n_bytes > self.max_bytes and len(self._blocks) > 1:
            self.n_bytes -= self._blocks.pop(next(iter(self._blocks))).n_bytes
