"""Capsules: a few round-ended cylinders that enclose the trunk and the main limbs, for collision."""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.limb_tree import LimbTree

MOST = 24  # capsules of one tree; physics engines take many more, but a forest has many trees
THICK = 0.2  # wood at least that thick, as a share of the trunk's radius, is worth running into
ROOM = 1.06  # the mesh's wood is uneven by 5 % of its radius (GeneralisedCylinders.roughness)
FLARE = 0.25  # and at the ground wider by up to 20 % (GeneralisedCylinders.flare) and its unevenness,
FLARE_UP = 1.5  # which is gone so many radii above it (root_flare)
AIR = 0.1  # what a share of air inside a capsule, saved, counts against wood enclosed
FINEST = 12  # knots of a limb at which it may be cut


@dataclass(frozen=True, eq=False)
class Capsules:
    """C capsules: all points within `radius` of the straight line from start to end. Metres."""

    start: NDArray[np.float64]  # (C, 3)
    end: NDArray[np.float64]  # (C, 3)
    radius: NDArray[np.float64]  # (C,)
    limb: NDArray[np.int64]  # (C,) the limb it stands for; the trunk's are 0

    def __post_init__(self) -> None:
        freeze(
            self,
            start=(np.float64, "C", 3),
            end=(np.float64, "C", 3),
            radius=(np.float64, "C"),
            limb=(np.int64, "C"),
        )

    def __len__(self) -> int:
        return len(self.radius)

    def outside(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far (P,) points (P, 3) are from the nearest capsule's surface, m; negative inside."""
        least = np.full(len(points), np.inf)
        for a, b, radius in zip(self.start, self.end, self.radius, strict=True):
            least = np.minimum(least, _distance(points, a, b) - radius)
        return least


def collision_capsules(tree: LimbTree, most: int = MOST) -> Capsules:
    """At most `most` capsules around the thick wood of a tree, from the trunk outward.

    The trunk's is the first. Each next one goes where it is worth most: to the limb without one that has
    most wood, or where cutting a capsule in two saves most air (which counts AIR of as much wood).
    """
    runs = _thick_runs(tree)
    waiting = sorted(runs[1:], key=lambda run: -_volume_of_wood(*run[1:]))
    pieces: list[_Piece] = []
    queue: list[tuple[float, int, tuple[_Piece, _Piece]]] = []

    def offer(k: int, piece: _Piece) -> None:
        pieces[k : k + 1] = [piece]
        if (halves := piece.cut()) is not None:
            heappush(queue, (-AIR * (piece.air - halves[0].air - halves[1].air), k, halves))

    offer(0, _Piece.around(*runs[0]))
    while len(pieces) < most and (queue or waiting):
        if waiting and (not queue or _volume_of_wood(*waiting[0][1:]) > -queue[0][0]):
            offer(len(pieces), _Piece.around(*waiting.pop(0)))
        else:
            _, k, halves = heappop(queue)
            offer(k, halves[0])
            offer(len(pieces), halves[1])
    pieces.sort(key=lambda piece: (piece.limb, piece.begin))
    ends = np.array([[piece.point[0], piece.point[-1]] for piece in pieces])
    radius, limb = np.array([piece.radius for piece in pieces]), np.array([piece.limb for piece in pieces])
    return Capsules(ends[:, 0], ends[:, 1], radius, limb)


@dataclass(frozen=True, eq=False)
class _Piece:
    """A run of a limb's knots in one capsule."""

    limb: int
    begin: int  # the first knot's place in its limb
    point: NDArray[np.float64]  # (K, 3)
    wide: NDArray[np.float64]  # (K,) radius that is to be inside
    radius: float  # of the capsule around it
    air: float  # m3 in the capsule that are not wood

    @staticmethod
    def around(limb: int, point: NDArray[np.float64], wide: NDArray[np.float64], begin: int = 0) -> _Piece:
        radius = float((_distance(point, point[0], point[-1]) + wide).max())
        length = float(np.linalg.norm(point[-1] - point[0]))
        volume = np.pi * radius**2 * (length + 4 / 3 * radius)
        return _Piece(limb, begin, point, wide, radius, volume - _volume_of_wood(point, wide))

    def cut(self) -> tuple[_Piece, _Piece] | None:
        """The two pieces that hold least air together, where they hold less; None for a single stretch."""
        best: tuple[_Piece, _Piece] | None = None
        least = self.air
        for k in np.unique(np.linspace(1, len(self.point) - 2, FINEST).astype(np.int64)) if len(self.point) > 2 else []:
            low = _Piece.around(self.limb, self.point[: k + 1], self.wide[: k + 1], self.begin)
            high = _Piece.around(self.limb, self.point[k:], self.wide[k:], self.begin + int(k))
            if low.air + high.air < least:
                best, least = (low, high), low.air + high.air
        return best


def _thick_runs(tree: LimbTree) -> list[tuple[int, NDArray[np.float64], NDArray[np.float64]]]:
    """Limb, knots (K, 3) and radii with room (K,) of each limb's thick beginning of at least two knots; trunk first."""
    limbs, skeleton = tree.limbs, tree.skeleton
    point, radius = skeleton.position[limbs.node], skeleton.radius[limbs.node].copy()
    side = limbs.first[1:-1]
    radius[side] = np.minimum(radius[side], radius[np.minimum(side + 1, len(radius) - 1)])  # not as thick as its parent
    trunk = float(radius[0])
    up = (point[:, 1] - point[0, 1]) / max(FLARE_UP * trunk, 1e-9)
    flare = np.where(limbs.limb == 0, FLARE * np.clip(1 - up, 0, 1), 0)
    wide = radius * (ROOM + flare)
    is_thick = radius >= THICK * trunk
    runs = []
    for limb, (begin, stop) in enumerate(zip(limbs.first[:-1].tolist(), limbs.first[1:].tolist(), strict=True)):
        thin = np.flatnonzero(~is_thick[begin:stop])
        end = begin + int(thin[0]) if len(thin) else stop
        if limb == 0:
            end = max(end, begin + 2)
        if end - begin >= 2:
            runs.append((limb, *_finer(point[begin:end], wide[begin:end])))
    return runs


def _finer(point: NDArray[np.float64], wide: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Knots (K, 3) and radii (K,) with one more in the middle of each stretch: long ones can be cut too."""
    twice = np.arange(2 * len(point) - 1) / 2
    at = np.arange(len(point))
    return np.stack([np.interp(twice, at, point[:, k]) for k in range(3)], axis=1), np.interp(twice, at, wide)


def _volume_of_wood(point: NDArray[np.float64], wide: NDArray[np.float64]) -> float:
    """Volume (m3) of the cones through points (K, 3) with radii (K,)."""
    a, b = wide[:-1], wide[1:]
    return float((np.pi / 3 * np.linalg.norm(np.diff(point, axis=0), axis=1) * (a * a + a * b + b * b)).sum())


def _distance(points: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance (P,) of points (P, 3) from the segment a to b."""
    chord = b - a
    square = float(chord @ chord)
    t = np.clip((points - a) @ chord / square, 0, 1) if square > 0 else np.zeros(len(points))
    return np.asarray(np.linalg.norm(points - a - t[:, None] * chord, axis=1))
