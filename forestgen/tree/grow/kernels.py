"""Compiled inner loops of growth: distances from attractors to segments, pruning, nearest nodes.

Each has a plain version in the tests that gives the same result (tests/tree/grow/plain.py).
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@nb.njit(cache=True, nogil=True, inline="always")
def _distance2(p: Array, a: Array, b: Array) -> Any:
    """Squared distance of a point (3,) to the segment from a to b."""
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    qx, qy, qz = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    length2 = dx * dx + dy * dy + dz * dz
    if length2 > 0.0:
        t = (qx * dx + qy * dy + qz * dz) / length2
        t = min(1.0, max(0.0, t))
        qx -= t * dx
        qy -= t * dy
        qz -= t * dz
    return qx * qx + qy * qy + qz * qz


@nb.njit(cache=True, nogil=True)
def lower_distances(a: Array, b: Array, target: Array, current: Array) -> None:
    """Lower, in place, the distances (S,) of targets (S, 3) to what segments (M, 3), (M, 3) make of them."""
    low, high = np.empty(3), np.empty(3)
    for begin in range(0, len(a), 16):
        stop = min(len(a), begin + 16)
        for k in range(3):
            low[k] = min(a[begin:stop, k].min(), b[begin:stop, k].min())
            high[k] = max(a[begin:stop, k].max(), b[begin:stop, k].max())
        for s in range(len(target)):
            best = current[s] * current[s]
            if _box_distance2(target[s], low, high) >= best:
                continue
            for m in range(begin, stop):
                best = min(best, _distance2(target[s], a[m], b[m]))
            current[s] = min(current[s], np.sqrt(best))


@nb.njit(cache=True, nogil=True, inline="always")
def _box_distance2(p: Array, low: Array, high: Array) -> Any:
    """Squared distance of a point (3,) to a box."""
    total = 0.0
    for k in range(3):
        if p[k] < low[k]:
            total += (low[k] - p[k]) ** 2
        elif p[k] > high[k]:
            total += (p[k] - high[k]) ** 2
    return total


@nb.njit(cache=True, nogil=True)
def improvements(
    a: Array, b: Array, group: Array, start: Array, target: Array, current: Array, first: int
) -> tuple[Array, Array, Array]:
    """What each of C placements would lower, sparse: offsets (C + 1,), targets (E,), distances (E,).

    Placement c holds the segments start[c] to start[c + 1]; segments of one branch follow each other
    and bear one number in `group` (M,). Only targets from `first` on are looked at.
    """
    n_place, n_target = len(start) - 1, len(target)
    pointer = np.zeros(n_place + 1, np.int64)
    capacity = 1024
    which, distance = np.empty(capacity, np.int32), np.empty(capacity, np.float64)
    count = 0
    low, high = np.empty((len(a) + 1, 3)), np.empty((len(a) + 1, 3))
    cut, to_box = np.empty(len(a) + 2, np.int64), np.empty(len(a) + 1)
    for c in range(n_place):
        boxes = 0
        for m in range(start[c], start[c + 1]):
            if m == start[c] or group[m] != group[m - 1]:
                cut[boxes] = m
                for k in range(3):
                    low[boxes, k] = min(a[m, k], b[m, k])
                    high[boxes, k] = max(a[m, k], b[m, k])
                boxes += 1
            else:
                for k in range(3):
                    low[boxes - 1, k] = min(low[boxes - 1, k], b[m, k])
                    high[boxes - 1, k] = max(high[boxes - 1, k], b[m, k])
        cut[boxes] = start[c + 1]
        whole_low, whole_high = np.full(3, np.inf), np.full(3, -np.inf)
        for box in range(boxes):
            for k in range(3):
                whole_low[k] = min(whole_low[k], low[box, k])
                whole_high[k] = max(whole_high[k], high[box, k])
        if boxes:
            for s in range(first, n_target):
                limit = current[s] * current[s]
                best = limit
                if _box_distance2(target[s], whole_low, whole_high) >= best:
                    continue
                nearest, to_nearest = 0, np.inf  # the branch to measure first: it rules out most others
                for box in range(boxes):
                    to_box[box] = _box_distance2(target[s], low[box], high[box])
                    if to_box[box] < to_nearest:
                        nearest, to_nearest = box, to_box[box]
                for turn in range(-1, boxes):
                    box = nearest if turn < 0 else turn
                    if to_box[box] < best and turn != nearest:
                        for m in range(cut[box], cut[box + 1]):
                            best = min(best, _distance2(target[s], a[m], b[m]))
                if best < limit:
                    if count == capacity:
                        which = np.concatenate((which, np.empty(capacity, np.int32)))
                        distance = np.concatenate((distance, np.empty(capacity, np.float64)))
                        capacity *= 2
                    which[count] = s
                    distance[count] = np.sqrt(best)
                    count += 1
        pointer[c + 1] = count
    return pointer, which[:count].copy(), distance[:count].copy()


@nb.njit(cache=True, nogil=True)
def gains(pointer: Array, which: Array, distance: Array, current: Array) -> Array:
    """By how much each placement (C,) would lower the sum of the current distances (S,)."""
    total = np.zeros(len(pointer) - 1)
    for c in range(len(total)):
        for e in range(pointer[c], pointer[c + 1]):
            fall = current[which[e]] - distance[e]
            if fall > 0.0:
                total[c] += fall
    return total


@nb.njit(cache=True, nogil=True)
def prune(
    parent: Array, group: Array, length: Array, may_pass: Array, may_end: Array, share: float, shortest: float
) -> Array:
    """Which nodes (M,) stay: those reached only through passable nodes, cut back to one where a branch may end.

    A branch of which less than `share` or less than the length `shortest` stays goes altogether, with
    all that it bears. `length` (M,) is that of the segment to each node; `parent` is -1 where a branch
    starts on its support; a branch's nodes follow each other.
    """
    n = len(parent)
    stays = np.zeros(n, np.bool_)
    begin = 0
    while begin < n:
        stop = begin + 1
        while stop < n and group[stop] == group[begin]:
            stop += 1
        last = begin - 1
        for m in range(begin, stop):
            above = parent[m]
            if (above >= 0 and not stays[above]) or not may_pass[m]:
                break
            stays[m] = True
            if may_end[m]:
                last = m
        for m in range(last + 1, stop):
            stays[m] = False
        left = length[begin : last + 1].sum()
        if left < shortest or left < share * length[begin:stop].sum() - 1e-9:
            stays[begin:stop] = False
        begin = stop
    return stays


@nb.njit(cache=True, nogil=True)
def distance_to_segments(point: Array, a: Array, b: Array) -> Array:
    """Distance of each point (N, 3) to the nearest of the segments (M, 3), (M, 3)."""
    away = np.full(len(point), np.inf)
    lower_distances(a, b, point, away)
    return away


@nb.njit(cache=True, nogil=True)
def nearest_nodes(node: Array, first: int, target: Array, open_: Array, away2: Array, nearest: Array) -> None:
    """Let targets (S, 3) that are open know, in place, of nodes from `first` on that are nearer than theirs."""
    for s in range(len(target)):
        if not open_[s]:
            continue
        for n in range(first, len(node)):
            dx = node[n, 0] - target[s, 0]
            dy = node[n, 1] - target[s, 1]
            dz = node[n, 2] - target[s, 2]
            d2 = dx * dx + dy * dy + dz * dz
            if d2 < away2[s]:
                away2[s] = d2
                nearest[s] = n
