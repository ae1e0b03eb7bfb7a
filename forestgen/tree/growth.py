"""Growth over time: any method's finished skeleton as it was at an earlier age (Kim & Jeong 2014, sec. II.3)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.errors import InputError
from forestgen.tree.growth_age import birth_times
from forestgen.tree.growth_kernels import carry, fronts, pose
from forestgen.tree.growth_tropism import bend_of_units
from forestgen.tree.skeleton import Skeleton, n_children
from forestgen.tree.strategy import Strategy


@dataclass(frozen=True)
class Mode:
    """What a growing tree changes (figure 9)."""

    is_ordered: bool  # nodes come one after another, by eq. 5; else all are there from the beginning
    thickens: bool  # wood is as thick as it is old
    smallest: float  # M, the tree's size as a share, goes from this to 1 with time


MODES = {
    "none": Mode(is_ordered=True, thickens=False, smallest=1.0),  # figure 9 left: no scaling
    # Middle: thickness, size and order. M is proportional to 1 / T of the latest node, which is the
    # time; but the order lengthens the tree as well, so that a seedling is not to vanish twice.
    "all": Mode(is_ordered=True, thickens=True, smallest=0.45),
    "scale": Mode(is_ordered=False, thickens=False, smallest=0.0),  # right: only scaling
}
STRONGEST = 60.0  # degrees of tropism; the paper's figure 8 goes from +20 to -25


@dataclass(frozen=True, kw_only=True)
class Growth(Strategy):
    """How a tree came to be (Kim & Jeong 2014, sec. II.3). Times are shares of the whole, 1 is the finished tree."""

    mode: str = "all"  # of MODES: figure 9
    # Eq. 5's w_p = 0.001 a pixel speaks of pictures; here ways and radii are shares of the greatest, and
    # 1 lets a thick trunk count as much as a tip's way ("structure more important than thickness").
    thickness_weight: float = 1.0
    tropism_deg: float = -7.0  # figure 8, between +20 (lifts) and -25 (droops): what a branch bends in its life
    wood_weight: float = 0.5  # ours: how much time goes by wood made, not by order; else a trunk alone takes half
    last_birth: float = 0.8  # ours: when the last wood is born; the rest is for the last leaves
    tapering: float = 0.1  # ours: how long wood takes to its full width where it does not thicken with age
    shooting: float = 0.03  # ours: how long wood takes to be as thick as a shoot; only then it thickens with age
    budding: float = 0.04  # ours: how long after its wood a leaf begins to show
    unfolding: float = 0.15  # ours: how long a leaf takes from bud to full size

    def __call__(self, skeleton: Skeleton) -> GrowingTree:
        """The tree over time.

        Raises:
            InputError: a setting makes no sense.
        """
        self.check()
        mode = MODES[self.mode]
        birth = np.zeros(len(skeleton))
        if mode.is_ordered:
            birth = birth_times(skeleton, self.thickness_weight, self.wood_weight, self.last_birth)
        bend = bend_of_units(skeleton, np.deg2rad(self.tropism_deg))
        return GrowingTree(skeleton, birth, bend, mode, self)

    def check(self) -> None:
        """Refuse settings beyond sense.

        Raises:
            InputError: names the setting.
        """
        if self.mode not in MODES:
            raise InputError(f"mode: expected one of {', '.join(MODES)}, came {self.mode!r}")
        if not abs(self.tropism_deg) <= STRONGEST:
            raise InputError(
                f"tropism: expected degrees between {-STRONGEST:g} and {STRONGEST:g}, came {self.tropism_deg:g}:"
                " the paper's trees take +20 (lifts) to -25 (droops)"
            )
        if not 0 <= self.thickness_weight < np.inf:
            raise InputError(f"thickness_weight: expected 0 or more, came {self.thickness_weight:g}")


@dataclass(frozen=True, eq=False)
class Pose:
    """A skeleton bent and scaled back to an age. N nodes.

    The ways along which branches are to grow are laid out up to the time `laid`, not before `time`:
    wood born between the two has its place, but no thickness yet.
    """

    time: float
    laid: float
    place: NDArray[np.float64]  # (N, 3) m, where each node is once it is born
    turn: NDArray[np.float64]  # (N, 3, 3) rotation of the unit that ends at each node
    front: NDArray[np.int64]  # (N,) the node at whose unit each node's way from the root is laid


@dataclass(frozen=True, eq=False)
class Anchors:
    """V points bound to a skeleton's units: each has its node's unit, its place along it and away from it."""

    node: NDArray[np.int64]  # (V,) the node at which the unit ends
    part: NDArray[np.float64]  # (V,) 0 at the unit's beginning, 1 at its end
    offset: NDArray[np.float64]  # (V, 3) m, from the unit's straight line to the point

    def __post_init__(self) -> None:
        freeze(self, node=(np.int64, "V"), part=(np.float64, "V"), offset=(np.float64, "V", 3))


@dataclass(frozen=True, eq=False)
class Wood:
    """The wood under V points: when it is born, and its radius in the end."""

    born: NDArray[np.float64]  # (V,) time
    radius: NDArray[np.float64]  # (V,) m


@dataclass(frozen=True, eq=False)
class GrowingTree:
    """A finished skeleton with the birth and bend of each node (N,): what it was at any time in (0, 1]."""

    skeleton: Skeleton
    birth: NDArray[np.float64]  # (N,) time, rising along every branch
    bend: NDArray[np.float64]  # (N,) radians
    mode: Mode
    growth: Growth

    def __post_init__(self) -> None:
        freeze(self, birth=(np.float64, "N"), bend=(np.float64, "N"))

    @cached_property
    def shoot(self) -> float:
        """Radius of a new shoot, metres: the tips' median."""
        return float(np.median(self.skeleton.radius[n_children(self.skeleton.parent) == 0]))

    def size(self, time: float) -> float:
        """M, the whole tree's scale."""
        return self.mode.smallest + (1 - self.mode.smallest) * time

    def pose(self, time: float, ahead: float = 0.0) -> Pose:
        """Bend and scale the skeleton back, its ways laid out for a time `ahead`."""
        rest = self.skeleton
        place, turn = pose(rest.position, rest.parent, self.birth, self.bend, time, self.size(time))
        return Pose(time, time + ahead, place, turn, fronts(rest.parent, self.birth, time + ahead))

    def wood(self, anchors: Anchors) -> Wood:
        """Birth and last radius of the wood under each point (V,)."""
        birth, radius = self.birth, self.skeleton.radius
        base = np.maximum(self.skeleton.parent[anchors.node], 0)
        return Wood(*(of[base] + anchors.part * (of[anchors.node] - of[base]) for of in (birth, radius)))

    def thickness(self, wood: Wood, time: float) -> NDArray[np.float64]:
        """Share (V,) of its last radius that wood has: never less than before, 1 at time 1."""
        if not self.mode.is_ordered:
            return np.full(len(wood.born), self.size(time))
        age = np.maximum(time - wood.born, 0)
        if not self.mode.thickens:
            return np.asarray(np.minimum(age / self.growth.tapering, 1))
        # First a shoot, then thicker: cross-sections grow evenly, every year adds as much wood.
        shoot = np.minimum(age / self.growth.shooting, 1) * np.minimum(self.shoot / np.maximum(wood.radius, 1e-9), 1)
        return np.asarray(np.maximum(shoot, self.size(time) * np.sqrt(np.minimum(age / (1 - wood.born), 1))))

    def carried(self, anchors: Anchors, at: Pose, thickness: NDArray[np.float64]) -> NDArray[np.float32]:
        """Where bound points (V, 3) are in a pose, their offsets times `thickness` (V,)."""
        bound = (anchors.node, anchors.part, anchors.offset, thickness)
        moved = carry(*bound, self.skeleton.parent, self.birth, at.place, at.turn, at.front, at.laid)
        return np.asarray(moved, np.float32)

    def at(self, time: float) -> Skeleton:
        """The skeleton at a time: nodes not yet born lie at the growing end of their branch, without radius."""
        if time >= 1:
            return self.skeleton
        n = len(self.skeleton)
        nodes = Anchors(np.arange(n), np.ones(n), np.zeros((n, 3)))
        share = self.thickness(self.wood(nodes), time)
        position = self.carried(nodes, self.pose(time), share)
        return Skeleton(position.astype(float), self.skeleton.parent, self.skeleton.radius * share)
