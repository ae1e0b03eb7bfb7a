"""Frames that travel along curves without twisting: rotation-minimising, all curves at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.limbs import unit


def mitre_tangents(centre: NDArray[np.float64], first: NDArray[np.int64]) -> NDArray[np.float64]:
    """Unit normal (R, 3) of the plane that halves each polyline's angle at each of its points.

    Points (R, 3) of many polylines one after another; `first` (L + 1,) bounds them.
    """
    chord = np.zeros_like(centre)
    chord[:-1] = unit(centre[1:] - centre[:-1])
    last = first[1:] - 1
    chord[last] = 0
    tangent = chord.copy()
    tangent[1:] += chord[:-1]
    tangent[first[:-1]] = chord[first[:-1]]
    folded = np.linalg.norm(tangent, axis=1) < 1e-6  # a hairpin: keep to the way ahead
    tangent[folded] = chord[folded]
    return unit(tangent)


def start_normals(tangent: NDArray[np.float64], away: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors (L, 3) across the tangents (L, 3), as nearly along `away` (3,) as can be."""
    normal = away - (tangent @ away)[:, None] * tangent
    along = np.linalg.norm(normal, axis=1) < 0.2
    other = np.roll(away, 1)
    normal[along] = other - (tangent[along] @ other)[:, None] * tangent[along]
    return unit(normal)


def transport(
    centre: NDArray[np.float64], tangent: NDArray[np.float64], first: NDArray[np.int64], away: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Normals (R, 3) carried along each curve by double reflection (Wang et al. 2008, ACM TOG 27(1)).

    One reflection takes a point to the next, a second one its tangent to the next's; together they
    turn the frame by no more than the curve itself turns. All curves advance together, ring by ring.
    """
    normal = np.empty_like(tangent)
    normal[first[:-1]] = start_normals(tangent[first[:-1]], away)
    count = np.diff(first)
    longest_first = np.argsort(-count, kind="stable")
    start, count = first[:-1][longest_first], count[longest_first]
    for k in range(1, int(count.max(initial=0))):
        i = start[: np.searchsorted(-count, -k)] + k  # the curves that have a point k
        n, t = reflect(centre[i] - centre[i - 1], normal[i - 1], tangent[i - 1])
        n, _ = reflect(tangent[i] - t, n, t)
        normal[i] = unit(n - np.sum(n * tangent[i], axis=1, keepdims=True) * tangent[i])
    return normal


def reflect(axis: NDArray[np.float64], *vectors: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Mirror vectors (L, 3) in the planes across the axes (L, 3); a zero axis mirrors nothing."""
    square = np.sum(axis * axis, axis=1, keepdims=True)
    scale = 2 / np.where(square > 0, square, 1.0)
    return tuple(v - scale * np.sum(axis * v, axis=1, keepdims=True) * axis for v in vectors)
