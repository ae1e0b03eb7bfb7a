"""The compiled kernels of the particle flow again, as plainly as can be: what they must equal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.tree.lift.direction_field import DirectionField


def runge_kutta(
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    mass: NDArray[np.float64],
    steady: NDArray[np.float64],
    cameras: Sequence[Camera],
    fields: Sequence[DirectionField],
    weight: float,
    speed: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions and velocities (N, 3) one step later."""

    def change(x: NDArray[np.float64], v: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        drive = steady.copy()
        for camera, field in zip(cameras, fields, strict=True):
            drive += weight * (field.at(camera.project(x)) * [1, -1]) @ camera.axes[:2] / len(fields)
        drive = drive / np.maximum(np.linalg.norm(drive, axis=1), 1e-12)[:, None]
        return v, (drive * speed - v) / mass[:, None]

    x1, v1 = change(position, velocity)
    x2, v2 = change(position + x1 / 2, velocity + v1 / 2)
    x3, v3 = change(position + x2 / 2, velocity + v2 / 2)
    x4, v4 = change(position + x3, velocity + v3)
    return position + (x1 + 2 * x2 + 2 * x3 + x4) / 6, velocity + (v1 + 2 * v2 + 2 * v3 + v4) / 6


def meet_traces(
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    name: Sequence[int],
    node: NDArray[np.float64],
    onward: list[int],
    of: Sequence[int],
    group: list[int],
    tip: Sequence[int],
    near: float,
    least_turn: float,
) -> list[bool]:
    """Who meets a trace; `onward` and `group` are changed as the kernel changes them."""

    def owner(which: int) -> int:
        return which if group[which] == which else owner(group[which])

    done = []
    for p in range(len(position)):
        best, found = near, -1
        for n in range(len(node)):
            gap = float(np.linalg.norm(node[n] - position[p]))
            if gap < best and onward[n] >= 0 and owner(of[n]) != owner(name[p]):
                way = node[onward[n]] - node[n]
                if way @ velocity[p] >= least_turn * np.linalg.norm(way) * np.linalg.norm(velocity[p]):
                    best, found = gap, onward[n]
        if found >= 0:
            onward[tip[p]] = found
            group[owner(name[p])] = owner(of[found])
        done.append(found >= 0)
    return done
