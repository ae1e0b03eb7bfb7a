"""What colour painted foliage has: that of the leaves which the photo shows, or a plain green lit from above."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.closing import close

GREEN = (92, 112, 50)  # sRGB of a broad-leaved crown in daylight, where the photo has no leaf of its own
DARKEST, BRIGHTEST = 0.5, 1.35  # factors on it: under a painted mass, and on its top
LIGHT = np.array([-0.35, -0.8, 0.5])  # where the light comes from: the left, above, the front (x right, y down)
FEWEST = 0.02  # share of the foliage that the photo must show for its colours to be taken
REACH = 0.08  # sigma of where they are taken from, as a share of the foliage's longer side
WHOLE = 0.06  # of the foliage's longer side: gaps narrower than twice this part no crown
PARTS = 0.35  # how much of their own roundness what they part keeps
BORROWED, INVENTED = 0.05, 0.5  # share of leaf that such pixels count for: too little to be cut out as leaves


def dress_painted(
    rgb: NDArray[np.uint8], share: NDArray[np.float32], painted: NDArray[np.bool_], seen: NDArray[np.bool_]
) -> None:
    """Give painted pixels (H, W) of a picture (H, W, 3) a leaf's colour, in place; `seen` is foliage of the photo."""
    if np.count_nonzero(seen) >= FEWEST * np.count_nonzero(painted | seen):
        rgb[painted] = nearby(rgb, seen)[painted]
        share[painted] = BORROWED
    else:
        rgb[painted] = np.clip(np.outer(lit(painted)[painted], GREEN), 0, 255).astype(np.uint8)
        share[painted] = INVENTED


def nearby(rgb: NDArray[np.uint8], seen: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """For each pixel the mean colour (H, W, 3) of the seen ones around it; of all where none is near."""
    rows, columns = np.nonzero(seen)
    sigma = max(1.0, REACH * max(np.ptp(rows), np.ptp(columns)))
    weight = seen.astype(np.float32)
    layers = np.dstack([rgb * weight[..., None], weight]).astype(np.float32)
    total = cv2.GaussianBlur(layers, (0, 0), sigma) + np.float32(1e-4) * layers[seen].mean(axis=0)
    return np.asarray(np.clip(np.round(total[..., :3] / total[..., 3:]), 0, 255), np.uint8)


def lit(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Brightness (H, W) of a crown in the light: a round mass, and on it the smaller ones that its gaps part."""
    rows, columns = np.nonzero(mask)
    gap = WHOLE * max(float(np.ptp(rows)), float(np.ptp(columns)), 1.0)
    height = _dome(close(mask, gap)) + PARTS * _dome(mask)
    down, right = np.gradient(height)
    normal = np.dstack([-right, -down, np.ones_like(height)])
    facing = normal @ (LIGHT / np.linalg.norm(LIGHT)) / np.linalg.norm(normal, axis=2)
    return np.asarray(DARKEST + (BRIGHTEST - DARKEST) * np.clip(0.5 + 0.5 * facing, 0, 1))


def _dome(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Height (H, W), px, of a mask's parts taken as round masses."""
    inside = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    most = max(float(np.percentile(inside[mask], 95)), 1.0)
    rise = 1 - np.minimum(inside / most, 1)
    return np.asarray(cv2.GaussianBlur(most * np.sqrt(1 - rise**2), (0, 0), max(1.0, 0.15 * most)), np.float32)
