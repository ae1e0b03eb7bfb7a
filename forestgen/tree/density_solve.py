"""Optical depths of voxels from those of rays: plain least squares, or the likeliest of all that fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import lsqr

from forestgen.errors import StageError

STEPS = 200  # of either solver at most
SETTLED = 1e-3  # relative change of the misfit a step below which the solution stands
CLEAR = 1e-3  # optical depth of a ray that is told to be empty: the logarithm needs more than 0


def least_squares(rays: csr_array, seen: NDArray[np.float64], first: NDArray[np.float64]) -> NDArray[np.float64]:
    """The depths (N,) nearest to the first guess (N,) that fit those of the rays (R,) best; negative ones are empty.

    Raises:
        StageError: the solver did not converge; with its residual.
    """
    change, stop, steps, residual = lsqr(rays, seen - rays @ first, atol=1e-6, btol=1e-6, iter_lim=STEPS)[:4]
    if stop not in (0, 1, 2, 4, 5):
        raise StageError(f"density: least squares did not settle in {steps} steps; residual {residual:.3g}")
    return np.asarray(np.maximum(first + change, 0.0))


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
    misfit = np.inf
    for _ in range(STEPS):
        predicted = np.maximum(rays @ depth, 1e-12)
        ratio = np.log(seen / predicted)
        before, misfit = misfit, float((seen - predicted - predicted * ratio).sum())
        if before - misfit <= SETTLED * misfit or misfit <= SETTLED * seen.sum():
            return np.asarray(depth)
        depth = depth * np.exp(share * (back @ ratio))
    raise StageError(f"density: the most even solution did not settle in {STEPS} steps; misfit {misfit:.3g}")
