"""Polylines: points at given lengths along a stroke."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


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
