"""Soft edges: how much of each pixel along a mask's edge is covered, from the colours on its two sides."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

BAND = 2  # px on either side of the edge where a pixel may be mixed: a lens's blur, a JPEG's blocks
NEAR = 3.0  # sigma in px of the neighbourhood whose colours stand for tree and for background
EDGE_SAY = 0.05  # what the edge's own pixels count, where nothing else is near (a twig two pixels wide)
TOO_CLOSE = 12 / 255  # colour difference in sRGB below which mixtures cannot be told
STRAY, APART = 0.03, 0.02  # of the crown's size: patches less wide than that, farther than this from wider ones
FLECK = 1e-4  # of the crown's area: smaller lone patches of tree are noise; the truth has hardly any


def soften(rgb: NDArray[np.float32], is_tree: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Alpha (h, w) of a mask: within its narrow band the share of tree colour in each pixel.

    A pixel I between the local mean colours F of the tree and B of the background has
    alpha = (I - B).(F - B) / |F - B|^2. Where F and B are too alike the mask stays as it is.
    """
    mask = is_tree.astype(np.uint8)
    block = np.ones((3, 3), np.uint8)
    tree = _local_mean(rgb, cv2.erode(mask, block) + np.float32(EDGE_SAY) * mask)
    behind = _local_mean(rgb, cv2.erode(1 - mask, block) + np.float32(EDGE_SAY) * (1 - mask))
    wide = np.ones((2 * BAND + 1, 2 * BAND + 1), np.uint8)
    row, column = np.nonzero((cv2.dilate(mask, wide) > 0) & (cv2.erode(mask, wide) == 0))
    axis = tree[row, column] - behind[row, column]
    length = (axis**2).sum(axis=1)
    share = ((rgb[row, column] - behind[row, column]) * axis).sum(axis=1) / np.maximum(length, 1e-9)
    clear = length > TOO_CLOSE**2
    alpha = mask.astype(np.float32)
    alpha[row[clear], column[clear]] = np.clip(share[clear], 0, 1)
    return alpha


def without_flecks(alpha: NDArray[np.float32], least_area: float) -> NDArray[np.float32]:
    """The matte (h, w) without the lone patches that cover fewer pixels than that."""
    _, label, stats, _ = cv2.connectedComponentsWithStats((alpha > 0).astype(np.uint8), connectivity=8)
    covered = np.bincount(label.ravel(), (alpha >= 0.5).ravel(), len(stats))
    return np.where(covered[label] >= least_area, alpha, np.float32(0))


def without_strays(alpha: NDArray[np.float32], size_px: float) -> NDArray[np.float32]:
    """The matte (h, w) without the small patches that stand apart from all large ones.

    They are a neighbour's leaves, or the background in its gaps; a crown of `size_px` has its own tufts nearer.
    """
    _, label, stats, _ = cv2.connectedComponentsWithStats((alpha >= 0.5).astype(np.uint8), connectivity=8)
    is_large = stats[:, cv2.CC_STAT_AREA] >= (STRAY * size_px) ** 2
    is_large[0] = False
    if not is_large.any():
        return alpha
    away = cv2.distanceTransform((~is_large[label]).astype(np.uint8), cv2.DIST_L2, 5)
    nearest = np.full(len(stats), np.inf)
    np.minimum.at(nearest, np.asarray(label, np.int32).ravel(), away.ravel())
    is_stray = nearest > APART * size_px
    is_stray[0] = False
    rim = cv2.dilate(is_stray[label].astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    return np.where(is_stray[label] | (rim & (label == 0)), np.float32(0), alpha)


def _local_mean(rgb: NDArray[np.float32], weight: NDArray[np.float32]) -> NDArray[np.float32]:
    """Weighted mean colour (h, w, 3) of the pixels near each pixel."""
    mass = cv2.GaussianBlur(weight, (0, 0), NEAR)
    return np.asarray(cv2.GaussianBlur(rgb * weight[..., None], (0, 0), NEAR) / np.maximum(mass, 1e-6)[..., None])
