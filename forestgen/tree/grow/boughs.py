"""Boughs: the tiers of side branches that a single stem bears all round, as long and as steep as those seen."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.tree.grow.axes import Axis
from forestgen.tree.grow.crown_volume import CrownVolume
from forestgen.tree.grow.leaf_masses import FINEST, Hull

TIER = 1.3  # of a lobe's radius, from one tier to the next
TIERS = (0.035, 0.07)  # of the height: the least and the greatest distance of tiers
MANY = (4, 7)  # boughs of a tier, from 4 to 6
AZIMUTHS = 72  # that are looked at for a bough; the emptiest in which the photo has room gets it
ALONG = np.array([0.4, 0.7, 1.0])  # of a bough: places whose distance from the others counts
SHORT = 0.03  # of the height: what is shorter is left to the twigs
WHOLE = 0.5  # of a bough's length must fit into the picture's foliage
OUTER, CLAD = 0.3, 0.5  # from so far out on, so much of it must bear foliage: none stands bare before the trunk
STEEP = (-0.8, 1.5)  # rise over reach
TOP = 0.5  # by how much boughs at the top rise more steeply than the middle ones, and those at the foot less
WIDE = 0.3  # of a bough's reach: half-width of its spray at the foot; half as wide at the tip
WIDEST = 0.08  # of the height
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
    seen: NDArray[np.float64],
    *,
    rng: np.random.Generator,
) -> list[Bough]:
    """Tiers of boughs along a stem (P, 3), between the nodes (M, 3) of those that the photo shows.

    `lobe` is the radius of the outline's lobes, metres.
    """
    axes, low, high = hull.turned.axes, float(hull.turned.up[0]), float(hull.turned.up[-1])
    picture = replace(volume.crossing(), turned=None, masses=None)
    up = stem @ axes[1]
    step = float(np.clip(TIER * lobe, TIERS[0] * volume.height, TIERS[1] * volume.height))
    found: list[Bough] = []
    taken = seen
    for tip in np.arange(low + 0.3 * step, high - 0.5 * step, step):
        for _ in range(int(rng.integers(*MANY))):
            height = tip + rng.uniform(-0.35, 0.35) * step
            rise = steep + TOP * (2 * (height - low) / (high - low) - 1) + rng.normal(0, 0.08)
            for azimuth in _emptiest(stem, up, hull, height, rise, taken, rng=rng):
                one = _bough(stem, up, hull, picture, float(azimuth), height, rise, rng=rng)
                if one is not None:
                    found.append(one)
                    taken = np.concatenate([taken, one.points])
                    break
    return found


def _emptiest(
    stem: NDArray[np.float64],
    up: NDArray[np.float64],
    hull: Hull,
    height: float,
    rise: float,
    taken: NDArray[np.float64],
    *,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Azimuths all round, those first in which a bough to that height is farthest from wood (M, 3) that is there."""
    azimuth = (np.arange(AZIMUTHS) + rng.random(AZIMUTHS)) * 2 * np.pi / AZIMUTHS
    if not len(taken):
        return rng.permutation(azimuth)
    reach = hull.radius(azimuth, np.full(AZIMUTHS, height))
    foot = stem[np.argmin(np.abs(up - (height - rise * reach.mean())))] @ hull.turned.axes.T
    way = np.column_stack([np.cos(azimuth), np.full(AZIMUTHS, rise), np.sin(azimuth)]) * reach[:, None]
    points = (foot + ALONG[:, None, None] * way) @ hull.turned.axes  # (places, azimuths, 3)
    away, _ = cKDTree(taken).query(points.reshape(-1, 3))
    return np.asarray(azimuth[np.argsort(-away.reshape(len(ALONG), -1).mean(axis=0), kind="stable")])


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
    if not len(ends) or t[ends[-1]] < WHOLE or may_end[: ends[-1] + 1][t[: ends[-1] + 1] > OUTER].mean() < CLAD:
        return None
    kept = slice(0, int(ends[-1]) + 1)
    wide = np.where(may_end & (t > 0.2), spray_width(t, reach, picture.height), 0.0)
    return Bough(foot, points[kept], wide[kept])


def spray_width(along: NDArray[np.float64], reach: float, height: float) -> NDArray[np.float64]:
    """Half-widths (K,), metres, of the foliage about a bough at shares (K,) of its length, on a tree of a height."""
    return np.clip(WIDE * reach * (1 - 0.5 * along), 1.2 * FINEST * height, WIDEST * height)
