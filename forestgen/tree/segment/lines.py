"""Lines: how far a mask's edges run in one direction, as twigs' and limbs' do and leaves' do not."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

NEIGHBOURHOOD = 2.5  # in units of the detail: the stretch within which directions are compared


def edge_directions(mask: NDArray[np.bool_], detail: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """How strong a mask's edges are near each pixel and how much of that runs one way, each (h, w).

    Their quotient is the coherence of the structure tensor: 1 for parallel lines, 0 for no direction.
    `detail` is the sigma in px below which nothing is looked at.
    """
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), detail)
    dx, dy = cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1)
    reach = NEIGHBOURHOOD * detail
    xx, xy, yy = (cv2.GaussianBlur(product, (0, 0), reach) for product in (dx * dx, dx * dy, dy * dy))
    return np.asarray(xx + yy), np.hypot(xx - yy, 2 * xy)
