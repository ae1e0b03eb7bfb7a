"""Compiled inner loops of the particle flow: one Runge-Kutta step, and meeting the traces that others left.

Each has a plain version in the tests that gives the same result (tests/tree/lift/plain_flow.py).
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@nb.njit(cache=True, nogil=True, inline="always")
def _field_force(x: Array, lens: Array, grid: Array, vector: Array, out: Array) -> None:
    """Add to out (3,) the mean over V views of their fields at a point x (3,), turned into space.

    `lens` (V, 15): the camera's three axes, root and centre px, px per metre, 1 / distance (a row a
    view, see `flow_tracing.lens_of`); `grid` (V, 4): low corner and step px; `vector` (V, R, C, 2).
    """
    n_views, rows, columns = vector.shape[0], vector.shape[1], vector.shape[2]
    for i in range(n_views):
        c = lens[i]
        across = c[0] * x[0] + c[1] * x[1] + c[2] * x[2]
        up = c[3] * x[0] + c[4] * x[1] + c[5] * x[2]
        near = c[6] * x[0] + c[7] * x[1] + c[8] * x[2]
        shrink = 1.0 / max(1.0 - near * c[14], 1e-3)
        px = c[11] + (c[9] - c[11] + across * c[13]) * shrink
        py = c[12] + (c[10] - c[12] - up * c[13]) * shrink
        u = min(max((px - grid[i, 0]) / grid[i, 2], 0.0), columns - 1.0)
        v = min(max((py - grid[i, 1]) / grid[i, 3], 0.0), rows - 1.0)
        k, j = min(int(u), columns - 2), min(int(v), rows - 2)
        u -= k
        v -= j
        fx = (vector[i, j, k, 0] * (1 - u) + vector[i, j, k + 1, 0] * u) * (1 - v)
        fx += (vector[i, j + 1, k, 0] * (1 - u) + vector[i, j + 1, k + 1, 0] * u) * v
        fy = (vector[i, j, k, 1] * (1 - u) + vector[i, j, k + 1, 1] * u) * (1 - v)
        fy += (vector[i, j + 1, k, 1] * (1 - u) + vector[i, j + 1, k + 1, 1] * u) * v
        for a in range(3):
            out[a] += (c[a] * fx - c[3 + a] * fy) / n_views


@nb.njit(cache=True, nogil=True)
def runge_kutta(
    position: Array,
    velocity: Array,
    mass: Array,
    steady: Array,
    lens: Array,
    grid: Array,
    vector: Array,
    field: float,
    speed: float,
) -> None:
    """Move N particles by one step of unit time, in place: position (N, 3) m, velocity (N, 3) m a step (eq. 2).

    The force on a particle is a drive minus its velocity, so that it comes to the pace `speed` and the
    mass (N,) says in how many steps it turns. The drive is the unit vector of `field` times the mean
    direction field plus `steady` (N, 3), the pulls that hold during the step.
    """
    x, v, force = np.empty(3), np.empty(3), np.empty(3)
    dx, dv = np.empty((4, 3)), np.empty((4, 3))
    for p in range(len(position)):
        for stage in range(4):
            back = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
            for a in range(3):
                x[a] = position[p, a] + (back * dx[stage - 1, a] if stage else 0.0)
                v[a] = velocity[p, a] + (back * dv[stage - 1, a] if stage else 0.0)
                force[a] = 0.0
            _field_force(x, lens, grid, vector, force)
            norm = 0.0
            for a in range(3):
                force[a] = field * force[a] + steady[p, a]
                norm += force[a] * force[a]
            norm = max(np.sqrt(norm), 1e-12)
            for a in range(3):
                dx[stage, a] = v[a]
                dv[stage, a] = (force[a] / norm * speed - v[a]) / mass[p]
        for a in range(3):
            position[p, a] += (dx[0, a] + 2 * dx[1, a] + 2 * dx[2, a] + dx[3, a]) / 6
            velocity[p, a] += (dv[0, a] + 2 * dv[1, a] + 2 * dv[2, a] + dv[3, a]) / 6


@nb.njit(cache=True, nogil=True, inline="always")
def _cell_of(x: float, y: float, z: float, low: Array, edge: float, shape: Array) -> tuple[int, int, int]:
    i = min(max(int((x - low[0]) / edge), 0), shape[0] - 1)
    j = min(max(int((y - low[1]) / edge), 0), shape[1] - 1)
    k = min(max(int((z - low[2]) / edge), 0), shape[2] - 1)
    return i, j, k


@nb.njit(cache=True, nogil=True)
def enter_cells(
    node: Array, first: int, last: int, head: Array, following: Array, low: Array, edge: float, shape: Array
) -> None:
    """Put nodes first to last of (M, 3) into the cells' lists: `head` (cells,), `following` (M,); -1 ends a list."""
    for n in range(first, last):
        i, j, k = _cell_of(node[n, 0], node[n, 1], node[n, 2], low, edge, shape)
        cell = (i * shape[1] + j) * shape[2] + k
        following[n] = head[cell]
        head[cell] = n


@nb.njit(cache=True, nogil=True, inline="always")
def _owner(group: Array, which: int) -> int:
    while group[which] != which:
        group[which] = group[group[which]]
        which = group[which]
    return which


@nb.njit(cache=True, nogil=True)
def meet_traces(
    position: Array,
    velocity: Array,
    name: Array,
    head_node: Array,
    node: Array,
    onward: Array,
    of: Array,
    group: Array,
    head: Array,
    following: Array,
    low: Array,
    edge: float,
    shape: Array,
    near: float,
    least_turn: float,
) -> Array:
    """Let each of N particles that comes `near` to another's trace end there; answers who did (N,).

    `name` (N,) is a particle's number and `head_node` (N,) the last node of its trace. Of the M nodes
    so far, `node` (M, 3) m, `onward` (M,) is the next towards the root (-1 at the end of a trace that
    still moves), and `of` (M,) the particle that left it. `group` merges the numbers of all particles
    that end on one trace: a particle cannot meet what leads to itself. It meets only what runs its way:
    the cosine of the angle between its velocity and the trace is at least `least_turn`.
    """
    done = np.zeros(len(position), np.bool_)
    for p in range(len(position)):
        x, y, z = position[p, 0], position[p, 1], position[p, 2]
        vx, vy, vz = velocity[p, 0], velocity[p, 1], velocity[p, 2]
        pace = max(np.sqrt(vx * vx + vy * vy + vz * vz), 1e-12)
        own = _owner(group, name[p])
        i, j, k = _cell_of(x, y, z, low, edge, shape)
        best, found = near * near, -1
        for ci in range(max(i - 1, 0), min(i + 2, shape[0])):
            for cj in range(max(j - 1, 0), min(j + 2, shape[1])):
                for ck in range(max(k - 1, 0), min(k + 2, shape[2])):
                    n = head[(ci * shape[1] + cj) * shape[2] + ck]
                    while n >= 0:
                        dx, dy, dz = node[n, 0] - x, node[n, 1] - y, node[n, 2] - z
                        d2 = dx * dx + dy * dy + dz * dz
                        if d2 < best and onward[n] >= 0 and _owner(group, of[n]) != own:
                            m = onward[n]
                            tx, ty, tz = node[m, 0] - node[n, 0], node[m, 1] - node[n, 1], node[m, 2] - node[n, 2]
                            long = max(np.sqrt(tx * tx + ty * ty + tz * tz), 1e-12)
                            if (tx * vx + ty * vy + tz * vz) >= least_turn * long * pace:
                                best, found = d2, m
                        n = following[n]
        if found >= 0:
            onward[head_node[p]] = found
            group[own] = _owner(group, of[found])
            done[p] = True
    return done
