"""Strokes: what a person drew over one tree in one photo."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze


@dataclass(frozen=True, eq=False)
class DensityStroke:
    """Painted foliage (`add`) or a painted hole (Neubert et al. 2007, sec. 9)."""

    add: bool
    radius_px: float
    path: NDArray[np.float64]  # (K, 2) xy px

    def __post_init__(self) -> None:
        freeze(self, path=(np.float64, "K", 2))


@dataclass(frozen=True, eq=False)
class Strokes:
    """One tree's strokes in pixels of the upright photo. K points a stroke."""

    crown: NDArray[np.float64]  # (K, 2) closed outline, first point not repeated
    branches: tuple[NDArray[np.float64], ...]  # each (K_i, 2); the first is the trunk, from the root upward
    background: tuple[NDArray[np.float64], ...] = ()  # each (K_i, 2)
    density: tuple[DensityStroke, ...] = ()
    size: tuple[int, int] | None = None  # (width, height) of the photo it was drawn on
    photo: str = ""  # a hint for people

    @property
    def root(self) -> NDArray[np.float64]:
        """Where the tree stands (2,): the first point of the trunk stroke."""
        return self.branches[0][0]


def load_strokes(path: Path) -> Strokes:
    """Read a stroke set (hardened by the stroke loader's tests)."""
    d = json.loads(path.read_text())
    lines = lambda key: tuple(np.array(b, float) for b in d.get(key, []))  # noqa: E731
    density = tuple(DensityStroke(s["add"], s["radius"], np.array(s["path"], float)) for s in d.get("density", []))
    return Strokes(
        np.array(d["crown"], float),
        lines("branches"),
        lines("background"),
        density,
        tuple(d["size"]),
        d.get("photo", ""),
    )


def fill_outline(outline: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Pixels (H, W) inside a closed outline (K, 2) px; even-odd where it crosses itself."""
    mask = np.zeros(size[::-1], np.uint8)
    cv2.fillPoly(mask, [np.round(outline - 0.5).astype(np.int32)], 1)
    return mask > 0


def draw_polyline(path: NDArray[np.float64], size: tuple[int, int], width_px: int = 1) -> NDArray[np.bool_]:
    """Pixels (H, W) under a polyline (K, 2) px."""
    mask = np.zeros(size[::-1], np.uint8)
    cv2.polylines(mask, [np.round(path - 0.5).astype(np.int32)], False, 1, width_px)
    return mask > 0
