"""Optical depths of voxels from those of rays: plain least squares, or the likeliest of all that fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from forestgen.errors import StageError

STEPS = 200  # of either solver at most
SETTLED = 5e-3  # relative change of the misfit a step below which the solution stands
CLEAR = 1e-3  # optical depth of a ray that is told to be empty: the logarithm needs more than 0


def least_squares(rays: csr_array, seen: NDArray[np.float64], first: NDArray[np.float64]) -> NDArray[np.float64]:
    """The depths (N,) that fit those of the rays (R,) best, on the way from a first guess (N,); negative is empty.

    Simultaneous reconstruction (SIRT, Cimmino's weights): every voxel takes the mean of what its rays miss, each
    divided by the length of the ray. Voxels that would turn negative are emptied at every step, not at the end:
    what they gave up is then the others' to explain.

    Raises:
        StageError: the misfit did not settle; with its root mean square.
    """
    along = 1 / np.maximum(np.asarray(rays.sum(axis=1)).ravel(), 1e-12)
    share = 1 / np.maximum(np.asarray(rays.sum(axis=0)).ravel(), 1e-12)
    back = csr_array(rays.T)
    depth, misfit, least = first, np.inf, SETTLED**2 * float(along @ seen**2)
    for _ in range(STEPS):
        missing = seen - rays @ depth
        before, misfit = misfit, float(along @ missing**2)
        if before - misfit <= SETTLED * misfit or misfit <= least:
            return depth
        depth = np.maximum(depth + share * (back @ (along * missing)), 0.0)
    raise StageError(f"density: least squares did not settle in {STEPS} steps; misfit {np.sqrt(misfit):.3g}")


def most_even(rays: csr_array, seen: NDArray[np.float64], first: NDArray[np.float64]) -> NDArray[np.float64]:
    """The depths (N,) of least divergence from the first guess (N,) that fit those of the rays (R,).

    Simultaneous multiplicative reconstruction (SMART): every voxel is scaled by the mean ratio, in logarithms,
    of what its rays show to what they predict. It keeps depths positive and empty voxels empty, and where the
    views leave a choice it keeps the guess's proportions (maximum relative entropy).

    Raises:
        StageError: the misfit did not settle; with its value.
    """
    met = np.flatnonzero(rays @ (first > 0).astype(float) > 1e-6)
    rays, seen = rays[met], np.maximum(seen[met], CLEAR)
    share = 1 / np.maximum(np.asarray(rays.sum(axis=0)).ravel(), 1e-12)
    back = csr_array(rays.T)
    depth = first * (seen.sum() / max((rays @ first).sum(), 1e-12))
    misfit, least = np.inf, SETTLED**2 * float(seen.sum())
    for _ in range(STEPS):
        predicted = np.maximum(rays @ depth, 1e-12)
        ratio = np.log(seen / predicted)
        before, misfit = misfit, float((seen - predicted - predicted * ratio).sum())
        if before - misfit <= SETTLED * misfit or misfit <= least:
            return np.asarray(depth)
        depth = depth * np.exp(share * (back @ ratio))
    raise StageError(f"density: the most even solution did not settle in {STEPS} steps; misfit {misfit:.3g}")
