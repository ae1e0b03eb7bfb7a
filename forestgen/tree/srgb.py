"""sRGB and linear light: light adds and scales in the latter, pictures are stored in the former."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB primaries (ITU-R BT.709)


def linear_from_srgb(srgb: ArrayLike) -> NDArray[np.float64]:
    """Linear light of sRGB-encoded values in [0, 1], any shape (IEC 61966-2-1)."""
    value = np.asarray(srgb, float)
    return np.asarray(np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4))


def srgb_from_linear(linear: ArrayLike) -> NDArray[np.float64]:
    """sRGB-encoded values of linear light in [0, 1], any shape (IEC 61966-2-1)."""
    value = np.clip(np.asarray(linear, float), 0.0, 1.0)
    return np.asarray(np.where(value <= 0.0031308, value * 12.92, 1.055 * value ** (1 / 2.4) - 0.055))


def linear_from_bytes(srgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Linear light of sRGB bytes, any shape."""
    return np.asarray(_LINEAR[srgb])


def bytes_from_linear(linear: ArrayLike) -> NDArray[np.uint8]:
    """sRGB bytes of linear light in [0, 1], any shape."""
    return np.asarray(np.round(255 * srgb_from_linear(linear)), np.uint8)


_LINEAR = linear_from_srgb(np.arange(256) / 255).astype(np.float32)
