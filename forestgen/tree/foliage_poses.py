"""How a leaf stands: its axis away from the twig and drooping, its face turned to the light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.foliage_twigs import Stations, across


def unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (N, 3) of length 1; a zero vector stays zero."""
    return np.asarray(vector / np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), 1e-12))


def leaf_axes(
    stations: Stations, insertion: float, droop: float, spread: float, *, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Unit axes (S, 3) from petiole to tip: `insertion` radians off the twig, drawn down by `droop`, jittered."""
    angle = insertion + rng.normal(0, 0.2, len(stations))
    axis = np.cos(angle)[:, None] * stations.twig + np.sin(angle)[:, None] * stations.outward
    axis = axis + rng.normal(0, spread, axis.shape)
    axis[:, 1] -= droop * rng.uniform(0.5, 1.5, len(axis))
    return unit(axis)


def light_normals(
    axis: NDArray[np.float64], outside: NDArray[np.float64], spread: float, *, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Unit normals (S, 3) across the axes, turned up and towards the crown's outside (S, 3), jittered."""
    light = unit(outside) + np.array([0.0, 0.9, 0.0])
    wish = light + rng.normal(0, spread, axis.shape)
    return normals_across(axis, wish)


def normals_across(axis: NDArray[np.float64], wish: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part (S, 3) of the wished directions across the axes, unit; any direction across where none is left."""
    normal = wish - np.sum(wish * axis, axis=1, keepdims=True) * axis
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    side, _ = across(axis)
    return np.where(length > 1e-6, normal / np.maximum(length, 1e-6), side)


def frames(axis: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrices (S, 3, 3) whose columns are where leaf space's x, y and z go."""
    return np.stack([np.cross(axis, normal), axis, normal], axis=2)


def quaternions(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit quaternions (S, 4) w x y z of rotation matrices (S, 3, 3), w >= 0."""
    m = rotation
    trace = m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2]
    squares = np.stack([1 + trace] + [1 - trace + 2 * m[:, k, k] for k in range(3)], axis=1)
    largest = squares.argmax(axis=1)
    q = np.empty((len(m), 4))
    off = [m[:, 2, 1], m[:, 1, 2], m[:, 0, 2], m[:, 2, 0], m[:, 1, 0], m[:, 0, 1]]
    w_terms = [off[0] - off[1], off[2] - off[3], off[4] - off[5]]  # 4 w x, 4 w y, 4 w z
    pair = {(0, 1): off[4] + off[5], (0, 2): off[2] + off[3], (1, 2): off[0] + off[1]}  # 4 x y, 4 x z, 4 y z
    for case in range(4):
        pick = largest == case
        terms = np.empty((int(pick.sum()), 4))
        for k in range(4):
            if k == case:
                terms[:, k] = squares[pick, case]
            elif 0 in (k, case):
                terms[:, k] = w_terms[max(k, case) - 1][pick]
            else:
                terms[:, k] = pair[min(k, case) - 1, max(k, case) - 1][pick]
        q[pick] = terms
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    return np.asarray(np.where(q[:, :1] < 0, -q, q))
