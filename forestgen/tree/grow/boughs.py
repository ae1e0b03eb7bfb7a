"""Boughs: the tiers of side branches that a single stem bears all round, as long and as steep as those seen."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow.axes import Axis
from forestgen.tree.grow.crown_volume import CrownVolume
from forestgen.tree.grow.leaf_masses import FINEST, Hull

TIER = 1.3  # of a lobe's radius, from one tier to the next
TIERS = (0.035, 0.07)  # of the height: the least and the greatest distance of tiers
MANY = (3, 6)  # boughs of a tier, from 3 to 5
TRIES = 6  # azimuths that are tried for a bough, before the photo is taken to show none there
SHORT = 0.03  # of the height: what is shorter is left to the twigs
WHOLE = 0.5  # of a bough's length must fit into the picture's foliage
STEEP = (-0.8, 1.5)  # rise over reach
TOP = 0.5  # by how much boughs at the top rise more steeply than the middle ones, and those at the foot less
WIDE = 0.2  # of a bough's reach: half-width of its spray at the foot; half as wide at the tip
WIDEST = 0.05  # of the height
ARCH = 0.06  # of the reach


@dataclass(frozen=True, eq=False)
class Bough:
    """One side branch of the stem. K nodes."""

    foot: int  # index of the stem's node that bears it
    points: NDArray[np.float64]  # (K, 3) m
    width: NDArray[np.float64]  # (K,) m, half-width of the foliage about each node; 0 where there is none


def steepness(position: NDArray[np.float64], axes: list[Axis], right: NDArray[np.float64], height: float) -> float:
    """Median rise over reach of the visible side branches in the picture; level where too few are seen."""
    found = []
    for axis in axes[1:]:
        way = position[axis.nodes[-1]] - position[axis.nodes[0]]
        if axis.order == 1 and abs(way @ right) > SHORT * height:
            found.append(float(way[1] / abs(way @ right)))
    return float(np.clip(np.median(found), *STEEP)) if len(found) > 1 else 0.0


def boughs_of(
    stem: NDArray[np.float64],
    hull: Hull,
    volume: CrownVolume,
    lobe: float,
    steep: float,
    *,
    rng: np.random.Generator,
) -> list[Bough]:
    """Tiers of boughs along a stem (P, 3), `lobe` the radius of the outline's lobes, metres."""
    axes, low, high = hull.turned.axes, float(hull.turned.up[0]), float(hull.turned.up[-1])
    picture = replace(volume.crossing(), turned=None, masses=None)
    up = stem @ axes[1]
    step = float(np.clip(TIER * lobe, TIERS[0] * volume.height, TIERS[1] * volume.height))
    found: list[Bough] = []
    for tip in np.arange(low + 0.3 * step, high - 0.5 * step, step):
        many = int(rng.integers(*MANY))
        first = rng.uniform(0, 2 * np.pi)
        for which in range(many):
            for _ in range(TRIES):
                azimuth = first + (which + rng.uniform(-0.3, 0.3)) * 2 * np.pi / many
                height = tip + rng.uniform(-0.35, 0.35) * step
                rise = steep + TOP * (2 * (height - low) / (high - low) - 1) + rng.normal(0, 0.08)
                one = _bough(stem, up, hull, picture, azimuth, height, rise, rng=rng)
                if one is not None:
                    found.append(one)
                    break
                first += 0.4
    return found


def _bough(
    stem: NDArray[np.float64],
    up: NDArray[np.float64],
    hull: Hull,
    picture: CrownVolume,
    azimuth: float,
    height: float,
    rise: float,
    *,
    rng: np.random.Generator,
) -> Bough | None:
    """A bough whose tip lies on the hull at an azimuth and a height, if the photo has room for most of it."""
    reach = float(hull.radius(np.array([azimuth]), np.array([height]))[0])
    if reach < SHORT * picture.height:
        return None
    foot = int(np.argmin(np.abs(up - (height - rise * reach))))
    start = stem[foot] @ hull.turned.axes.T
    rise = (height - start[1]) / reach
    if not STEEP[0] - TOP <= rise <= STEEP[1] + TOP:
        return None
    t = np.linspace(0, 1, 3 + int(reach / (0.025 * picture.height)))[1:]
    sideways = azimuth + rng.normal(0, 0.12) * t
    arch = ARCH * np.sin(np.pi * t) * (1 if rise < 0.3 else -1)
    way = np.column_stack([np.cos(sideways) * t, rise * t + arch, np.sin(sideways) * t]) * reach
    points = (start + way) @ hull.turned.axes
    may_pass, may_end = picture.allows(points)
    may_pass &= picture.spans(np.vstack([stem[foot], points[:-1]]), points)
    stop = len(t) if may_pass.all() else int(np.argmin(may_pass))
    ends = np.flatnonzero(may_end[:stop])
    if not len(ends) or t[ends[-1]] < WHOLE:
        return None
    kept = slice(0, int(ends[-1]) + 1)
    wide = np.clip(WIDE * reach * (1 - 0.5 * t), 1.2 * FINEST * picture.height, WIDEST * picture.height)
    return Bough(foot, points[kept], np.where(may_end & (t > 0.2), wide, 0.0)[kept])
