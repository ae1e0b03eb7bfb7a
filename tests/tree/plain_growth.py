"""Plain versions of the compiled loops of growth over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def printed_rotation(axis: Array, angle: float) -> Array:
    """Eq. 8 of Kim & Jeong 2014 as printed, without its last row and column, for a unit axis (3,)."""
    x, y, z = axis
    a, b, c = np.cos(angle), np.sin(angle), 1 - np.cos(angle)
    return np.array(
        [
            [x * x * c + a, y * x * c + z * b, z * x * c - y * b],
            [x * y * c - z * b, y * y * c + a, z * y * c + x * b],
            [x * z * c + y * b, y * z * c - x * b, z * z * c + a],
        ]
    )


def plain_pose(
    rest: Array, parent: NDArray[np.int64], birth: Array, bend: Array, time: float, size: float
) -> tuple[Array, Array]:
    """What `pose` gives: eq. 7 and 8, unit by unit."""
    place, turn = rest.copy(), np.tile(np.eye(3), (len(parent), 1, 1))
    for i in range(1, len(parent)):
        p = parent[i]
        d = rest[i] - rest[p]
        rho = turn[p] @ d
        turn[i] = turn[p]
        axis = np.cross(rho / np.linalg.norm(rho), [0.0, -1.0, 0.0])
        sine = np.linalg.norm(axis)
        left = 1 - np.clip((time - birth[i]) / (1 - birth[i]), 0, 1)
        if sine > 1e-12:
            turn[i] = printed_rotation(axis / sine, -bend[i] * left * sine) @ turn[p]
        place[i] = place[p] + size * turn[i] @ d
    return place, turn


def plain_axis(parent: NDArray[np.int64], birth: Array, place: Array, node: int, part: float, laid: float) -> Array:
    """Where on a posed skeleton the place `part` of a node's unit is, if ways are laid out up to a time."""
    above = parent[node]
    if above < 0:
        return place[node]
    born = birth[above] + part * (birth[node] - birth[above])
    if born <= laid:
        return place[above] + part * (place[node] - place[above])
    if birth[above] > laid:
        return plain_axis(parent, birth, place, above, 1.0, laid)
    share = (laid - birth[above]) / (birth[node] - birth[above])
    return place[above] + share * (place[node] - place[above])
