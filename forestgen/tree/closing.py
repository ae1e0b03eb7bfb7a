"""Masks grown and closed by discs of any radius: by distances, whose cost does not grow with the disc."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def dilate(mask: NDArray[np.bool_], radius: float) -> NDArray[np.bool_]:
    """The mask (H, W) grown by a disc of a radius, px."""
    if not mask.any():
        return mask
    away = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(away <= radius)


def close(mask: NDArray[np.bool_], radius: float) -> NDArray[np.bool_]:
    """The mask (H, W) with gaps closed that a disc of the radius, px, does not fit in."""
    room = int(np.ceil(radius)) + 1
    grown = dilate(np.pad(mask, room), radius)
    return ~dilate(~grown, radius)[room:-room, room:-room]
