"""Polylines: points at given lengths along a stroke, and how tall all strokes are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.strokes import Strokes


def length_along(path: NDArray[np.float64]) -> NDArray[np.float64]:
    """Length (K,) px from the start of a polyline (K, 2) to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])


def point_at(path: NDArray[np.float64], length: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (S, 2) at lengths (S,) px along a polyline (K, 2)."""
    along = length_along(path)
    return np.column_stack([np.interp(length, along, path[:, 0]), np.interp(length, along, path[:, 1])])


def resample(path: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Points (S, 2) along a polyline, about `step` px apart, its start and its end among them."""
    whole = float(length_along(path)[-1])
    return point_at(path, np.linspace(0, whole, max(1, round(whole / step)) + 1))


def drawn_height(strokes: Strokes) -> float:
    """Height of the strokes in the photo, px: what all lengths of a trace are measured by."""
    rows = np.concatenate([strokes.crown, *strokes.branches])[:, 1]
    return max(float(strokes.root[1] - rows.min()), float(np.ptp(rows)), 1.0)
