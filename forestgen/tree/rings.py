"""Rings: where along the limbs the cross-sections of the branch mesh stand, and how wide they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.frames import mitre_tangents
from forestgen.tree.limb_curves import STEPS, LimbCurves
from forestgen.tree.limbs import unit

MARGIN = 0.85  # share of the way to the point where two rings would cross that they may use


@dataclass(frozen=True, eq=False)
class Rings:
    """R cross-sections, limb after limb from base to end; `first` (M,), M = L + 1, bounds the limbs."""

    first: NDArray[np.int64]  # (M,)
    station: NDArray[np.float64]  # (R,) m along the common axis of LimbCurves
    centre: NDArray[np.float64]  # (R, 3) m
    tangent: NDArray[np.float64]  # (R, 3) unit normal of the section's plane, towards the tip
    radius: NDArray[np.float64]  # (R,) m

    def __post_init__(self) -> None:
        freeze(
            self,
            first=(np.int64, "M"),
            station=(np.float64, "R"),
            centre=(np.float64, "R", 3),
            tangent=(np.float64, "R", 3),
            radius=(np.float64, "R"),
        )

    @property
    def limb(self) -> NDArray[np.int64]:
        """The limb of each ring (R,)."""
        return np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))


def needed_stations(
    curves: LimbCurves, tolerance: NDArray[np.float64], longest: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Stations (R,) of as few rings as the curves' bends allow, and their limbs (R,).

    A chord of length h strays from a curve of curvature c by c h^2 / 8; rings are dealt so that
    this stays below `tolerance` (K,) metres and no two are further apart than `longest` (K,) metres:
    equal shares of the integral of sqrt(c / (8 tolerance)) + 1 / longest along the limb.
    """
    limbs = curves.limbs
    step = curves.step.reshape(-1, 3)
    length = np.linalg.norm(step, axis=1)
    ahead = unit(step)
    turn = 2 * np.arcsin(np.clip(np.linalg.norm(ahead[1:] - ahead[:-1], axis=1) / 2, 0, 1))
    turn[(length[1:] <= 0) | (length[:-1] <= 0)] = 0
    need = np.sqrt(turn * (length[1:] + length[:-1]) / 2 / (8 * np.repeat(tolerance, STEPS)[1:]))
    share = length / np.repeat(longest, STEPS)
    share[1:] += need / 2
    share[:-1] += need / 2
    share[length <= 0] = 0
    total = np.concatenate([[0.0], np.cumsum(share)])
    low, high = total[limbs.first[:-1] * STEPS], total[(limbs.first[1:] - 1) * STEPS]
    n_steps = np.maximum(1, np.ceil(high - low).astype(np.int64))
    first = np.concatenate([[0], np.cumsum(n_steps + 1)])
    limb = np.repeat(np.arange(len(limbs)), n_steps + 1)
    part = (np.arange(first[-1]) - first[limb]) / n_steps[limb]
    place = np.interp(low[limb] + part * (high - low)[limb], total[:-1], np.arange(len(length)))
    station = np.interp(place, np.arange(len(length)), curves.station)
    station[first[:-1]] = curves.begin
    station[first[1:] - 1] = curves.end
    return station, limb


def with_zones(
    station: NDArray[np.float64],
    limb: NDArray[np.int64],
    zone_station: NDArray[np.float64],
    zone_limb: NDArray[np.int64],
    curves: LimbCurves,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Let prescribed stations (Z,) replace the others over the stretch of a limb that they cover.

    A limb's first and last ring stay; prescribed stations beyond 90 % of a limb are left out.
    """
    begin, end = curves.begin, curves.end
    fits = zone_station < begin[zone_limb] + 0.9 * (end - begin)[zone_limb]
    zone_station, zone_limb = zone_station[fits], zone_limb[fits]
    reach = np.full(len(begin), -np.inf)
    np.maximum.at(reach, zone_limb, zone_station)
    slack = 0.3 * curves.radius_at(station)
    ends = np.isin(station, begin) | np.isin(station, end)
    keeps = ends | (station > reach[limb] + slack)
    both = np.concatenate([station[keeps], zone_station])
    order = np.argsort(both, kind="stable")
    return both[order], np.concatenate([limb[keeps], zone_limb])[order]


def crossing_room(
    centre: NDArray[np.float64], tangent: NDArray[np.float64], first: NDArray[np.int64]
) -> NDArray[np.float64]:
    """How wide (R,) a ring may be before it crosses its neighbours' planes, metres.

    Two section planes at an angle a meet; a ring of radius r stays on its side of a neighbour's
    plane at distance d as long as r sin(a) < d. Unlimited where the planes are parallel.
    """
    room = np.full(len(centre), np.inf)
    i = np.arange(len(centre) - 1)
    i = np.delete(i, first[1:-1] - 1)
    chord = centre[i + 1] - centre[i]
    sine = np.maximum(np.linalg.norm(np.cross(tangent[i], tangent[i + 1]), axis=1), 1e-12)
    facing = np.sum(tangent[i] * tangent[i + 1], axis=1) > 0
    for own, other in ((i + 1, i), (i, i + 1)):
        distance = np.where(facing, np.sum(chord * tangent[other], axis=1), 0)
        np.minimum.at(room, own, np.maximum(distance, 0) / sine)
    return room


def place_rings(
    curves: LimbCurves, station: NDArray[np.float64], limb: NDArray[np.int64], swell: float, smallest: float
) -> Rings:
    """Rings at the given stations (R,), such that none pierces its neighbour.

    Where rings widened by `swell` would cross, every other of them is left out; what still
    crosses is drawn in, but never below `smallest` metres.
    """
    n_limbs = len(curves.limbs)
    for attempt in range(5):
        first = np.searchsorted(limb, np.arange(n_limbs + 1))
        centre, radius = curves.at(station), curves.radius_at(station)
        tangent = mitre_tangents(centre, first)
        room = MARGIN * crossing_room(centre, tangent, first) / swell
        crosses = radius > room
        crosses[first[:-1]] = False
        crosses[first[1:] - 1] = False
        if attempt == 4 or not crosses.any():
            break
        drops = crosses & (np.arange(len(station)) % 2 == attempt % 2)
        station, limb = station[~drops], limb[~drops]
    return Rings(first, station, centre, tangent, np.maximum(np.minimum(radius, room), smallest))
