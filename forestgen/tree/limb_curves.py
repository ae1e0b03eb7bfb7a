"""Limb curves: smooth paths through the knots of limbs, measured by arc length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.limbs import Limbs, unit
from forestgen.tree.skeleton import Skeleton

STEPS = 6  # straight pieces a cubic between two knots is measured with
APART = 1.0  # metres of nothing between two limbs on the common arc-length axis
N_RELAX = 8  # smoothing passes over the nodes of thick, finely traced limbs


@dataclass(frozen=True, eq=False)
class LimbCurves:
    """One cubic Hermite path a limb, all of them on one axis of arc length (`station`, metres).

    K knots; S = K STEPS dense stations. Limb l covers stations `begin[l]` to `end[l]`.
    """

    limbs: Limbs
    position: NDArray[np.float64]  # (K, 3) m
    radius: NDArray[np.float64]  # (K,) m
    leaving: NDArray[np.float64]  # (K, 3) derivative at the start of the piece after the knot
    arriving: NDArray[np.float64]  # (K, 3) derivative at the end of the piece before the knot
    step: NDArray[np.float64]  # (K, STEPS, 3) chords of each piece; zero after a limb's last knot
    station: NDArray[np.float64]  # (S,) of each dense point
    knot_station: NDArray[np.float64]  # (K,)

    def __post_init__(self) -> None:
        freeze(
            self,
            position=(np.float64, "K", 3),
            radius=(np.float64, "K"),
            leaving=(np.float64, "K", 3),
            arriving=(np.float64, "K", 3),
            step=(np.float64, "K", STEPS, 3),
            station=(np.float64, "S"),
            knot_station=(np.float64, "K"),
        )

    @property
    def begin(self) -> NDArray[np.float64]:
        return self.knot_station[self.limbs.first[:-1]]

    @property
    def end(self) -> NDArray[np.float64]:
        return self.knot_station[self.limbs.first[1:] - 1]

    def at(self, station: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (R, 3) of the paths at stations (R,)."""
        place = np.interp(station, self.station, np.arange(len(self.station)) / STEPS)
        knot = np.minimum(place.astype(np.int64), len(self.position) - 2)
        return hermite(self, knot, (place - knot)[:, None])

    def radius_at(self, station: NDArray[np.float64]) -> NDArray[np.float64]:
        """Radii (R,) at stations (R,), linear between knots."""
        return np.asarray(np.interp(station, self.knot_station, self.radius))


def hermite(curves: LimbCurves, knot: NDArray[np.int64], t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (R, 3) at t in [0, 1] (R, 1) of the pieces after knots (R,); a limb's last knot stays."""
    ends = np.where(curves.limbs.has_next[knot], knot + 1, knot)
    return cubic(curves.position[knot], curves.leaving[knot], curves.arriving[ends], curves.position[ends], t)


def cubic(
    a: NDArray[np.float64],
    da: NDArray[np.float64],
    db: NDArray[np.float64],
    b: NDArray[np.float64],
    t: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The cubic from a to b with derivatives da and db, at t in [0, 1]."""
    s = 1 - t
    return np.asarray(a * s * s * (1 + 2 * t) + da * t * s * s - db * t * t * s + b * t * t * (3 - 2 * t))


def relaxed(
    skeleton: Skeleton, continues: NDArray[np.int64], limit: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Node positions (N, 3) and radii (N,) with the tracing's zigzag ironed out.

    A node moves towards the chord of its neighbours on the limb where the nodes lie closer
    together than the limb is thick (wider apart, bends are true), never by more than `limit` (N,)
    metres; ends of limbs stay.
    """
    node = np.flatnonzero((continues >= 0) & (skeleton.parent >= 0))
    before, after = skeleton.parent[node], continues[node]
    p, r = skeleton.position.copy(), skeleton.radius.copy()
    follows = continues[before] == node  # the radius of a side limb owes nothing to its parent's
    for _ in range(N_RELAX if len(node) else 0):
        a = np.linalg.norm(p[node] - p[before], axis=1)
        b = np.linalg.norm(p[after] - p[node], axis=1)
        share = (a / np.maximum(a + b, 1e-300))[:, None]
        pull = 0.5 * np.clip(2 * r[node] / np.maximum(a + b, 1e-300), 0, 1)
        p[node] += pull[:, None] * ((1 - share) * p[before] + share * p[after] - p[node])
        moved = p[node] - skeleton.position[node]
        far = np.linalg.norm(moved, axis=1)
        p[node] = skeleton.position[node] + moved * np.minimum(1, limit[node] / np.maximum(far, 1e-300))[:, None]
        level = (1 - share[:, 0]) * np.where(follows, r[before], r[node]) + share[:, 0] * r[after]
        r[node] += pull * (level - r[node])
    return p, r


def knot_tangents(limbs: Limbs, position: NDArray[np.float64], lean: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit direction (K, 3) of the limb at each knot (K, 3).

    Inside a limb that of the parabola through the knot and its neighbours; at its end the same
    bend goes on; at its base the limb leans by `lean` (L,) towards its parent's direction.
    """
    chord = np.zeros_like(position)
    chord[:-1] = position[1:] - position[:-1]
    chord[~limbs.has_next] = 0
    long = np.linalg.norm(chord, axis=1, keepdims=True)
    along = unit(chord)
    tangent = along.copy()
    inner = np.flatnonzero(limbs.has_next)
    inner = inner[~np.isin(inner, limbs.first[:-1])]
    tangent[inner] = unit(along[inner - 1] * long[inner] + along[inner] * long[inner - 1])
    last, base = limbs.first[1:] - 1, limbs.first[:-1]
    tangent[last] = along[last - 1]
    bends = last[last - base > 1]
    tangent[bends] = unit(1.5 * along[bends - 1] - 0.5 * tangent[bends - 1])
    side = np.flatnonzero(limbs.parent >= 0)
    stem = tangent[limbs.socket[side]]
    turn = np.sum(stem * along[base[side]], axis=1)
    weight = lean[side] * np.clip(1 + turn, 0, 1)  # a branch that turns back does not lean
    tangent[base[side]] = unit(along[base[side]] + weight[:, None] * stem)
    return tangent


def curve_through(
    limbs: Limbs,
    position: NDArray[np.float64],
    radius: NDArray[np.float64],
    lean: NDArray[np.float64],
    bow: NDArray[np.float64],
) -> LimbCurves:
    """Lay a smooth path through each limb's knots: position (K, 3), radius (K,), metres.

    `bow` (K,) bounds, in metres, how far the piece after a knot may stray from its straight chord:
    the derivative is shortened there, which rounds the corner more tightly and keeps its direction.
    """
    has_next = limbs.has_next
    tangent = knot_tangents(limbs, position, lean)
    ends = np.where(has_next, np.arange(len(position)) + 1, np.arange(len(position)))
    chord = position[ends] - position
    long = np.linalg.norm(chord, axis=1)
    along = unit(chord)

    def derivative(direction: NDArray[np.float64]) -> NDArray[np.float64]:
        across = direction - np.sum(direction * along, axis=1, keepdims=True) * along
        strays = np.linalg.norm(across, axis=1) * long
        return np.asarray(direction * (long * np.minimum(1, 4 * bow / np.maximum(strays, 1e-300)))[:, None])

    leaving = derivative(tangent)
    arriving = np.zeros_like(position)
    arriving[1:] = derivative(tangent[ends])[:-1]
    t = np.linspace(0, 1, STEPS + 1)[None, :, None]
    dense = cubic(position[:, None], leaving[:, None], arriving[ends, None], position[ends, None], t)
    step = np.diff(dense, axis=1)
    step[~has_next] = 0
    length = np.linalg.norm(step, axis=2)
    length[~has_next, 0] = APART  # the way over to the next limb
    station = np.concatenate([[0.0], np.cumsum(length)])[:-1]
    return LimbCurves(limbs, position, radius, leaving, arriving, step, station, station[::STEPS])
