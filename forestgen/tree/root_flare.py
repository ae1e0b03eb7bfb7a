"""Root flare: a trunk widens into the ground, more so where a root leaves it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

HEIGHTS = np.array([0.0, 0.12, 0.27, 0.45, 0.7, 1.05, 1.5, 2.1, 3.0])  # of rings over the root, in trunk radii
FALL = 0.75  # height over which the flare falls to 1/e, in trunk radii
TOES = ((5, 0.5, 0.4), (3, 0.35, 2.1), (2, 0.2, 4.0))  # waves around the foot: number, height, phase


def flare_stations(begin: float, sink: float, radius: float) -> NDArray[np.float64]:
    """Stations (Z,) of rings that resolve the flare of a trunk that starts `sink` metres below ground."""
    return np.asarray(begin + sink + HEIGHTS * radius)


def remaining_flare(flare: float, radius: float, radius_above: float) -> float:
    """The flare still to add, given how much the skeleton's own radii widen towards the root."""
    own = radius / max(radius_above, 1e-300)
    return float(np.clip((1 + flare) / own - 1, 0, flare))


def flared(height: NDArray[np.float64], angle: NDArray[np.float64], radius: float, flare: float) -> NDArray[np.float64]:
    """Factor (P,) on the trunk's radius at heights (P,) m above the root and angles (P,) around it."""
    falls = np.exp(-np.maximum(height, 0) / (FALL * radius))
    toes = sum(high * np.cos(number * angle + phase) for number, high, phase in TOES)
    return np.asarray(1 + flare * falls * (1 + toes * falls))
