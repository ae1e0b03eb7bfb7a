"""Mip levels of a cut-out atlas that keep its coverage: leaves that do not thin out with distance.

Where a texel counts from alpha one half on, the mean of four of them counts seldom at a leaf's edge and
hardly ever in a needle, so plain mip levels lose leaves. Castaño 2010 ("Computing Alpha Mipmaps") scales
each level's alpha so that as many texels count as before. To test a plain level against a lower threshold
does the same: both are given here, the threshold exactly, by rank.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.png import write_png
from forestgen.tree.srgb import bytes_from_linear, linear_from_bytes

THRESHOLD = 0.5  # from which a texel counts: opacityThreshold of the written material
FAINT = 1 / 255  # weight of colour where there is no alpha: bled colours count where no other does


@dataclass(frozen=True, eq=False)
class Mips:
    """Levels of a texture, each half as wide and high as the one before, down to one texel. K levels."""

    kept: tuple[NDArray[np.uint8], ...]  # (H_k, W_k, 4): alpha scaled, test it against THRESHOLD
    thresholds: NDArray[np.float64]  # (K,) what plain levels are to be tested against instead, in (0, 1]
    coverage: NDArray[np.float64]  # (K,) share of texels that count on the kept levels
    plain_coverage: NDArray[np.float64]  # (K,) and would on plain ones, against THRESHOLD

    def __post_init__(self) -> None:
        freeze(
            self,
            thresholds=(np.float64, "K"),
            coverage=(np.float64, "K"),
            plain_coverage=(np.float64, "K"),
        )


def build_mips(rgba: NDArray[np.uint8]) -> Mips:
    """All levels of a texture (H, W, 4), sRGB and straight alpha. Level 0 is the texture itself."""
    alpha = rgba[..., 3].astype(np.float32) / np.float32(255)
    goal = float((alpha >= THRESHOLD).mean())
    level = np.dstack([linear_from_bytes(rgba[..., :3]) * (alpha + FAINT)[..., None], alpha])
    kept, thresholds, plain = [rgba], [THRESHOLD], [goal]
    while max(level.shape[:2]) > 1:
        level = halve(level)
        alpha = level[..., 3]
        thresholds.append(threshold_for(alpha, goal))
        plain.append(float((alpha >= THRESHOLD).mean()))
        colour = level[..., :3] / (alpha + FAINT)[..., None]
        kept.append(np.dstack([bytes_from_linear(colour), scale_alpha(alpha, thresholds[-1])]))
    coverage = [float((image[..., 3] >= THRESHOLD * 255).mean()) for image in kept]
    return Mips(tuple(kept), np.array(thresholds), np.array(coverage), np.array(plain))


def halve(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """The box-filtered image (H // 2, W // 2, C), at least one texel high and wide."""
    height, width = image.shape[:2]
    return np.asarray(cv2.resize(image, (max(1, width // 2), max(1, height // 2)), interpolation=cv2.INTER_AREA))


def threshold_for(alpha: NDArray[np.float32], goal: float) -> float:
    """The threshold that the share `goal` of alpha (H, W) reaches, as nearly as whole texels allow.

    One texel stays where there was any: on the last levels a leaf would go altogether.
    """
    if not goal:
        return 1.0
    value, count = np.unique(alpha, return_counts=True)
    reached = np.cumsum(count[::-1])[::-1]  # how many texels have that much alpha or more
    best = int(np.argmin(np.abs(reached - goal * alpha.size)))
    below = float(value[best - 1]) if best else 0.0
    return float(np.clip((float(value[best]) + below) / 2, 0.5 / 255, 1.0))


def scale_alpha(alpha: NDArray[np.float32], threshold: float) -> NDArray[np.uint8]:
    """Alpha (H, W) as bytes, scaled so that what reached `threshold` now reaches THRESHOLD, and nothing else does."""
    scaled = np.round(255 * np.clip(alpha * (THRESHOLD / threshold), 0, 1))
    limit = np.ceil(THRESHOLD * 255)
    counts = alpha >= threshold
    return np.asarray(np.where(counts, np.maximum(scaled, limit), np.minimum(scaled, limit - 1)), np.uint8)


def write_mips(mips: Mips, folder: Path, stem: str) -> list[Path]:
    """Write the levels below the texture itself as folder/<stem>_mip1.png and so on; give their paths.

    Raises:
        OSError: a file could not be written.
    """
    paths = []
    for k, image in enumerate(mips.kept[1:], start=1):
        paths.append(folder / f"{stem}_mip{k}.png")
        write_png(paths[-1], image)
    return paths
