"""Compiled inner loops of growth over time: the posed skeleton, and points carried along with it.

Each has a plain version in the tests that gives the same result (tests/tree/plain_growth.py).
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@nb.njit(cache=True)
def pose(rest: Array, parent: Array, birth: Array, bend: Array, time: float, size: float) -> Any:
    """Bend and scale a finished skeleton back to what it was at `time`, whether born or not.

    Places rest (N, 3), birth (N,) and bend (N,) in radians. Gives places (N, 3) m and the rotation
    (N, 3, 3) of the unit that ends at each node: what its branch is still to bend, undone.
    """
    n = len(parent)
    place, turn = np.empty((n, 3)), np.empty((n, 3, 3))
    place[0] = rest[0]
    turn[0] = np.eye(3)
    for i in range(1, n):
        p = parent[i]
        d = rest[i] - rest[p]
        for k in range(3):
            for m in range(3):
                turn[i, k, m] = turn[p, k, m]
        left = 1.0 - min(1.0, max(0.0, (time - birth[i]) / (1.0 - birth[i])))
        if bend[i] != 0.0 and left > 0.0:
            _bend_back(turn[i], d, bend[i] * left)
        for k in range(3):
            along = turn[i, k, 0] * d[0] + turn[i, k, 1] * d[1] + turn[i, k, 2] * d[2]
            place[i, k] = place[p, k] + size * along
    return place, turn


@nb.njit(cache=True)
def _bend_back(turn: Array, d: Array, angle: float) -> None:
    """Turn a rotation (3, 3) in place by minus `angle` times sine about rho x g (eq. 7-8); rho is d (3,) so turned."""
    x = turn[0, 0] * d[0] + turn[0, 1] * d[1] + turn[0, 2] * d[2]
    y = turn[1, 0] * d[0] + turn[1, 1] * d[1] + turn[1, 2] * d[2]
    z = turn[2, 0] * d[0] + turn[2, 1] * d[1] + turn[2, 2] * d[2]
    flat = np.sqrt(x * x + z * z)
    length = np.sqrt(flat * flat + y * y)
    if flat < 1e-12 * length or length == 0.0:
        return
    ax, az = z / flat, -x / flat  # rho x (0, -1, 0) = (z, 0, -x)
    weighed = angle * flat / length
    a, b = np.cos(weighed), np.sin(weighed)
    for m in range(3):
        u, v, w = turn[0, m], turn[1, m], turn[2, m]
        dot = (ax * u + az * w) * (1.0 - a)
        turn[0, m] = a * u - b * az * v + ax * dot
        turn[1, m] = a * v + b * (az * u - ax * w)
        turn[2, m] = a * w + b * ax * v + az * dot


@nb.njit(cache=True)
def fronts(parent: Array, birth: Array, time: float) -> Any:
    """The node (N,) at whose unit each node's way from the root stands at `time`; its own where born."""
    front = np.empty(len(parent), np.int64)
    front[0] = 0
    for i in range(1, len(parent)):
        front[i] = i if birth[parent[i]] <= time else front[parent[i]]
    return front


@nb.njit(cache=True)
def carry(
    node: Array,
    part: Array,
    offset: Array,
    thickness: Array,
    parent: Array,
    birth: Array,
    place: Array,
    turn: Array,
    front: Array,
    laid: float,
) -> Any:
    """Where points (V, 3) stand: bound to the unit that ends at `node` (V,), at `part` (V,) of it.

    `offset` (V, 3) from the finished axis turns with the unit and is multiplied by `thickness` (V,).
    A point born later than the time `laid` is at that time's place on its way from the root.
    """
    out = np.empty((len(node), 3), np.float32)
    for v in range(len(node)):
        i = node[v]
        j, t = i, part[v]
        p = max(parent[i], 0)
        if birth[p] + part[v] * (birth[i] - birth[p]) > laid:
            j = front[i]
            q = max(parent[j], 0)
            span = birth[j] - birth[q]
            t = min(1.0, (laid - birth[q]) / span) if span > 0.0 else 0.0
        q = max(parent[j], 0)
        share = thickness[v]
        for k in range(3):
            side = turn[i, k, 0] * offset[v, 0] + turn[i, k, 1] * offset[v, 1] + turn[i, k, 2] * offset[v, 2]
            out[v, k] = place[q, k] + t * (place[j, k] - place[q, k]) + share * side
    return out


@nb.njit(cache=True, inline="always")
def _nearest_on(point: Array, a: Array, b: Array) -> Any:
    """Squared distance of a point (3,) from the segment a to b, and the place along it in [0, 1]."""
    dot, square, total = 0.0, 0.0, 0.0
    for k in range(3):
        dot += (point[k] - a[k]) * (b[k] - a[k])
        square += (b[k] - a[k]) ** 2
    t = min(1.0, max(0.0, dot / square)) if square > 0.0 else 0.0
    for k in range(3):
        total += (point[k] - a[k] - t * (b[k] - a[k])) ** 2
    return total, t


@nb.njit(cache=True)
def bind_to_ways(position: Array, parent: Array, end: Array, points: Array) -> Any:
    """The unit (V,) and place along it (V,) nearest to points (V, 3) on the way from the root to nodes `end` (V,)."""
    node, part = np.zeros(len(points), np.int64), np.zeros(len(points))
    for v in range(len(points)):
        best, i = np.inf, end[v]
        node[v] = i
        while parent[i] >= 0:
            distance, t = _nearest_on(points[v], position[parent[i]], position[i])
            if distance < best:
                best, node[v], part[v] = distance, i, t
            i = parent[i]
    return node, part


@nb.njit(cache=True)
def nearest_way(position: Array, parent: Array, candidate: Array, probe: Array) -> Any:
    """Which (L,) of the ways from the root to candidate nodes (L, C) passes nearest to all probes (L, Q, 3).

    Nearest is the least sum of squared distances, the first of equals. Probes count from the last, where ways
    part, and a way is given up once it is worse than the best so far: less than half the time of all sums.
    """
    n, c, q = candidate.shape[0], candidate.shape[1], probe.shape[1]
    nearest = np.zeros(n, np.int64)
    for limb in range(n):
        least = np.inf
        for k in range(c):
            total = 0.0
            for m in range(q - 1, -1, -1):
                best, i = np.inf, candidate[limb, k]
                if parent[i] < 0:
                    best = _nearest_on(probe[limb, m], position[i], position[i])[0]
                while parent[i] >= 0:
                    best = min(best, _nearest_on(probe[limb, m], position[parent[i]], position[i])[0])
                    i = parent[i]
                total += best
                if total >= least:
                    break
            if total < least:
                least, nearest[limb] = total, k
    return nearest


@nb.njit(cache=True)
def nearest_piece(position: Array, parent: Array, candidate: Array, points: Array) -> Any:
    """Of the units that end at candidate nodes (V, C) the node (V,) of the one nearest to points (V, 3), and the
    place along it (V,)."""
    node, part = np.zeros(len(points), np.int64), np.zeros(len(points))
    for v in range(len(points)):
        least = np.inf
        for k in range(candidate.shape[1]):
            i = candidate[v, k]
            distance, t = _nearest_on(points[v], position[max(parent[i], 0)], position[i])
            if distance < least:
                least, node[v], part[v] = distance, i, t
    return node, part
