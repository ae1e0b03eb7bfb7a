"""Pictures as PNG: no time stamp, the same bytes for the same pixels."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

FAST = 3  # zlib level of pictures that are large and many; cv2's own is lower still, and the files larger


def png_bytes(image: NDArray[np.uint8], level: int | None = None) -> bytes:
    """A picture (H, W), (H, W, 3) RGB or (H, W, 4) RGBA as PNG, packed at a zlib level.

    Raises:
        ValueError: the picture has no pixels, or another shape.
    """
    pixels = image if image.ndim == 2 else image[..., [2, 1, 0, 3][: image.shape[2]]]
    options = [] if level is None else [cv2.IMWRITE_PNG_COMPRESSION, level]
    if not image.size:
        raise ValueError(f"an image of shape {image.shape} cannot be written as PNG")
    is_encoded, data = cv2.imencode(".png", np.ascontiguousarray(pixels), options)
    if not is_encoded:
        raise ValueError(f"an image of shape {image.shape} cannot be written as PNG")
    return data.tobytes()


def write_png(path: Path, image: NDArray[np.uint8], level: int | None = None) -> None:
    """Write a picture as `png_bytes` packs it.

    Raises:
        ValueError: as `png_bytes`.
        OSError: the file could not be written.
    """
    path.write_bytes(png_bytes(image, level))
