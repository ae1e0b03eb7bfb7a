"""The smoothness term of Tan et al. 2008, sec. 2: what it costs that neighbours differ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def edge_costs(
    rgb: NDArray[np.float32], strength: float, guard: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """lambda / |I_x - I_y| towards the right and the lower neighbour, each (h, w), colours in levels of 0-255.

    At equal colours the paper's cost is infinite: differences below `guard` levels count as `guard`.
    """
    right, down = np.zeros((2, *rgb.shape[:2]), np.float32)
    right[:, :-1] = _cost(np.diff(rgb, axis=1), strength, guard)
    down[:-1] = _cost(np.diff(rgb, axis=0), strength, guard)
    return right, down


def _cost(step: NDArray[np.float32], strength: float, guard: float) -> NDArray[np.float32]:
    levels = np.float32(255) * np.sqrt(np.einsum("hwc,hwc->hw", step, step))
    return np.asarray(np.float32(strength) / np.maximum(levels, np.float32(guard)))
