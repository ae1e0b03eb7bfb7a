"""Normalized matting of a picture with scribbles, from coarse to fine."""

from __future__ import annotations

import logging

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.errors import StageError
from forestgen.tree.segment.laplacian import matting_laplacian
from forestgen.tree.segment.matte_ratio import Criterion, Minimum, minimise
from forestgen.tree.segment.trimap import BACKGROUND, TREE, UNKNOWN

log = logging.getLogger(__name__)

SMALLEST = 24  # px along the shorter side of the coarsest picture: smaller ones hold no scribble apart

Picture = NDArray[np.float64]


def normalized_alpha(
    rgb: NDArray[np.floating],
    trimap: Picture,
    *,
    radius: int = 1,
    epsilon: float = 1e-4,
    tolerance: float = 0.02,
    most_steps: int = 1000,
    nearby: NDArray[np.floating] | None = None,
    pull: float = 0.0,
) -> tuple[Picture, Minimum]:
    """Alpha (h, w) by Kim & Jeong 2014, eq. 3, and how the solver ended; rgb (h, w, 3) in [0, 1].

    `trimap` (h, w) is 0 and 1 where scribbles say so, one half elsewhere. Begins with `nearby`
    (h, w), where it is given, else with the matte of the picture at half the size. A matte always comes out; where
    `most_steps` do not reach the `tolerance` the log says so with the residual.

    Raises:
        StageError: no pixel is scribbled as tree or none as background: all or nothing would be the best matte.
    """
    for value, what in ((TREE, "tree"), (BACKGROUND, "background")):
        if not (trimap == value).any():
            raise StageError(f"no pixel is known to be {what}: matting needs a stroke on the tree and one beside it")
    first = coarse_alpha(rgb, trimap, radius, epsilon, tolerance, most_steps) if nearby is None else nearby
    laplacian = matting_laplacian(rgb, radius, epsilon)
    start = laplacian.pad(np.clip(np.where(trimap == UNKNOWN, first, trimap), 0, 1).astype(np.float64))
    pixels = np.flatnonzero(laplacian.pad(np.ones(trimap.shape, bool)))
    unknown = np.flatnonzero(laplacian.pad(trimap == UNKNOWN))
    found = minimise(Criterion(laplacian, pixels, unknown, start, pull), start, tolerance, most_steps)
    if not found.is_converged:
        log.warning(
            "normalized matting of %d x %d px stopped after %d steps with residual %.1e; expected at most %.1e",
            *(trimap.shape[1], trimap.shape[0], found.steps, found.residual, tolerance),
        )
    return laplacian.crop(found.alpha).copy(), found


def coarse_alpha(
    rgb: NDArray[np.floating], trimap: Picture, radius: int, epsilon: float, tolerance: float, most_steps: int
) -> Picture:
    """A start (h, w): the matte at half the size, enlarged; one half where the picture or a scribble is too small."""
    h, w = trimap.shape
    coarse = halved(trimap)
    if min(coarse.shape) < max(SMALLEST, 2 * radius + 1) or not (
        (coarse == TREE).any() and (coarse == BACKGROUND).any()
    ):
        return np.full(trimap.shape, UNKNOWN)
    small = np.asarray(cv2.resize(rgb, coarse.shape[::-1], interpolation=cv2.INTER_AREA), np.float64)
    alpha, _ = normalized_alpha(
        small, coarse, radius=radius, epsilon=epsilon, tolerance=tolerance, most_steps=most_steps
    )
    return np.asarray(cv2.resize(alpha, (w, h), interpolation=cv2.INTER_LINEAR), np.float64)


def halved(trimap: Picture) -> Picture:
    """The trimap at half the size: what one of four pixels says counts, unless another says the contrary."""
    rows, columns = trimap.shape[0] % 2, trimap.shape[1] % 2
    even = np.pad(trimap, ((0, rows), (0, columns)), mode="edge")
    blocks = even.reshape(even.shape[0] // 2, 2, even.shape[1] // 2, 2)
    is_tree, is_background = ((blocks == value).any(axis=(1, 3)) for value in (TREE, BACKGROUND))
    return np.where(is_tree == is_background, UNKNOWN, np.where(is_tree, TREE, BACKGROUND))
