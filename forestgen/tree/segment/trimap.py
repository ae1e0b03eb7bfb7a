"""Trimap: what of a photo is tree for certain, what is not, and what is left to closed-form matting."""

from __future__ import annotations

import logging
import sys

import cv2
import numpy as np
from numpy.typing import NDArray

log = logging.getLogger(__name__)

BACKGROUND, UNKNOWN, TREE = 0.0, 0.5, 1.0
STRIP_PIXELS = 500_000  # are solved at once: bounds the memory
OVERLAP = 24  # px of neighbouring strips: what is unknown is decided by what is known a few pixels off
LEAST_PULL = 1e-4  # keeps the system solvable where an unknown part touches nothing known
TOLERANCE = 1e-4  # relative residual at which the solution is good: alpha is read to a hundredth


def trimap_of(
    is_tree: NDArray[np.bool_], band: int, sure_tree: NDArray[np.bool_], sure_background: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Trimap (h, w) of a first mask: `band` px on either side of its edge are unknown where nothing is sure.

    Colours alone mislead there: a pixel that is half leaf and half sky looks like neither.
    """
    block = np.ones((2 * band + 1, 2 * band + 1), np.uint8)
    mask = is_tree.astype(np.uint8)
    trimap = np.full(is_tree.shape, UNKNOWN)
    trimap[cv2.dilate(mask, block) == 0] = BACKGROUND
    trimap[cv2.erode(mask, block) > 0] = TREE
    trimap[sure_background] = BACKGROUND
    trimap[sure_tree] = TREE
    return trimap


def unknown_alpha(
    rgb: NDArray[np.float32], trimap: NDArray[np.float64], nearby: NDArray[np.float32], pull: float, epsilon: float
) -> NDArray[np.float32]:
    """Alpha (h, w) with the unknown pixels by closed-form matting (Levin et al. 2008).

    Minimises a^T L a + pull |a - nearby|^2 over them, where L is the matting Laplacian and
    `nearby` (h, w) a first estimate. Goes in strips that overlap: L holds 25 numbers a pixel.

    Raises:
        ValueError: the solver does not converge.
    """
    height, width = trimap.shape
    rows = max(STRIP_PIXELS // max(width, 1), 4 * OVERLAP)
    alpha = np.empty((height, width), np.float32)
    for top in range(0, height, rows):
        low, bottom = max(top - OVERLAP, 0), min(top + rows, height)
        part = slice(low, min(bottom + OVERLAP, height))
        strip = solve_strip(rgb[part], trimap[part], nearby[part], max(pull, LEAST_PULL), epsilon)
        alpha[top:bottom] = strip[top - low : bottom - low]
    return alpha


def solve_strip(
    rgb: NDArray[np.float32], trimap: NDArray[np.float64], nearby: NDArray[np.float32], pull: float, epsilon: float
) -> NDArray[np.float64]:
    """One strip (h, w) of `unknown_alpha`, with PyMatting's Laplacian, preconditioner and solver."""
    is_unknown = (trimap == UNKNOWN).ravel()
    if not is_unknown.any():
        return trimap
    if "pymatting" not in sys.modules:
        log.info("loading PyMatting; its first time on a machine compiles for about a minute")
    from pymatting import cf_laplacian, cg, ichol  # only here: not on the path of other segmenters
    from scipy.sparse import csr_matrix, eye_array

    laplacian = cf_laplacian(rgb.astype(np.float64), epsilon=epsilon, is_known=~is_unknown)[is_unknown]
    inner, outer = laplacian[:, is_unknown], laplacian[:, ~is_unknown]
    system = csr_matrix(inner + pull * eye_array(inner.shape[0], format="csr"))
    first = nearby.ravel()[is_unknown].astype(np.float64)
    wanted = pull * first - outer @ trimap.ravel()[~is_unknown]
    alpha = trimap.ravel().copy()
    alpha[is_unknown] = cg(system, wanted, x0=first, M=ichol(system), rtol=TOLERANCE)
    return np.clip(alpha, 0, 1).reshape(trimap.shape)
