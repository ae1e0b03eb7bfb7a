"""Curve evolution: a mask's outlines with ever fewer vertices, the least relevant one gone first.

Discrete curve evolution of Latecki & Lakaemper 1999, as Kim & Jeong 2014 (sec. II.2, algorithm 1) and
Bai et al. 2007 use it. A vertex between the segments s1 and s2 is as relevant as

    R(s1, s2) = beta * l1 * l2 / (l1 + l2)

with the turn angle beta and lengths as shares of a whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from math import atan2, hypot

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze

FEWEST = 3  # vertices of a closed polygon


@dataclass(frozen=True, eq=False)
class Contours:
    """Closed polygons, one after the other. N points; those of one polygon are neighbours, in order."""

    xy: NDArray[np.float64]  # (N, 2) px; inside is on the same hand along every polygon, holes too
    ring: NDArray[np.int64]  # (N,) the polygon that a point belongs to: 0, 1, 2, ...

    def __post_init__(self) -> None:
        freeze(self, xy=(np.float64, "N", 2), ring=(np.int64, "N"))

    def __len__(self) -> int:
        return len(self.ring)

    def neighbours(self, kept: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The kept point before and after each of the kept ones (M,), in increasing order, on its own ring."""
        ring = self.ring[kept]
        first = np.flatnonzero(np.diff(ring, prepend=-1))
        last = np.append(first[1:], len(kept))[: len(first)] - 1
        before, after = np.arange(len(kept)) - 1, np.arange(len(kept)) + 1
        before[first], after[last] = last, first
        return kept[before], kept[after]

    def turns(self, kept: NDArray[np.int64]) -> NDArray[np.float64]:
        """Angles (M,) by which the polygons turn at the kept points (M,); above 0 where they are convex."""
        before, after = self.neighbours(kept)
        into, out = self.xy[kept] - self.xy[before], self.xy[after] - self.xy[kept]
        turn = np.arctan2(into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0], (into * out).sum(axis=1))
        return np.asarray(turn, np.float64)


def outlines_of(mask: NDArray[np.bool_]) -> Contours:
    """The outlines of all parts and holes of a mask (H, W); a point on each edge between inside and outside.

    Pixels that touch at a corner belong together, as thinning has it; even a line of single pixels
    has two sides.
    """
    from skimage.measure import find_contours  # its import is felt

    found = find_contours(np.pad(mask, 1).astype(float), 0.5, fully_connected="high")  # type: ignore[no-untyped-call]
    rings = [ring[:-1, ::-1] - 0.5 for ring in found]  # closed: the last point is the first; 1 px of frame
    ring = np.repeat(np.arange(len(rings)), [len(points) for points in rings])
    return Contours(np.concatenate([np.empty((0, 2)), *rings]), ring)


def relevance(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float], whole: float) -> float:
    """R of the vertex b between its neighbours a and c, lengths as shares of `whole`."""
    x1, y1, x2, y2 = b[0] - a[0], b[1] - a[1], c[0] - b[0], c[1] - b[1]
    l1, l2 = hypot(x1, y1), hypot(x2, y2)
    if l1 + l2 == 0:
        return 0.0
    return abs(atan2(x1 * y2 - y1 * x2, x1 * x2 + y1 * y2)) * l1 * l2 / ((l1 + l2) * whole)


def evolve(contours: Contours, *, whole: float, fewest: int = FEWEST, least: float = np.inf) -> NDArray[np.int64]:
    """The points (M,) that are left as vertices, in order, when the least relevant went one after the other.

    It ends when `fewest` vertices are left in all or when each is worth at least `least`; a polygon
    keeps its last three. Cost: N log N.
    """
    kept = _without_straight(contours)
    before, after = contours.neighbours(kept)
    place, ring = contours.xy.tolist(), contours.ring.tolist()  # plain lists: a loop over them is faster
    previous, following = [-1] * len(ring), [-1] * len(ring)
    for vertex, one, other in zip(kept.tolist(), before.tolist(), after.tolist(), strict=True):
        previous[vertex], following[vertex] = one, other
    worth = [0.0] * len(ring)  # -1: it went
    queue = []
    for vertex in kept.tolist():
        worth[vertex] = relevance(place[previous[vertex]], place[vertex], place[following[vertex]], whole)
        queue.append((worth[vertex], vertex))
    heapify(queue)
    left, n_left = np.bincount(contours.ring[kept]).tolist(), len(kept)
    while queue and n_left > fewest:
        value, vertex = heappop(queue)
        if value != worth[vertex]:
            continue  # it went, or was weighed anew since
        if value >= least:
            break
        if left[ring[vertex]] <= FEWEST:
            continue
        left[ring[vertex]] -= 1
        n_left -= 1
        worth[vertex] = -1.0
        a, c = previous[vertex], following[vertex]
        following[a], previous[c] = c, a
        for one in (a, c):
            worth[one] = relevance(place[previous[one]], place[one], place[following[one]], whole)
            heappush(queue, (worth[one], one))
    return kept[np.array(worth)[kept] >= 0]


def _without_straight(contours: Contours) -> NDArray[np.int64]:
    """The points (M,) at which the outline turns: all others have R = 0 and would go first."""
    every = np.arange(len(contours))
    if not len(every):
        return every
    turns = np.abs(contours.turns(every)) > 1e-9
    few = np.bincount(contours.ring, weights=turns) < FEWEST
    return np.flatnonzero(turns | few[contours.ring])
