"""Generic leaves, drawn by formula: for photos too coarse to cut leaves from, and the taper of those that are cut."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

SOFT = 1.2  # px of a cell over which a drawn edge goes from 0 to 1


def blade_grid(height: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """For each pixel (H, W) of a blade's cell: u across in [-1, 1], and t along in [0, 1] from base (below) to tip."""
    u = (np.arange(width) + 0.5) / width * 2 - 1
    t = 1 - (np.arange(height) + 0.5) / height
    return np.broadcast_to(u, (height, width)), np.broadcast_to(t[:, None], (height, width))


def half_width(t: NDArray[np.float64], widest: float, base: float, tip: float) -> NDArray[np.float64]:
    """Half width in [0, 1] of a blade at t along it: t^base (1-t)^tip, scaled to 1 at its widest.

    `widest` in (0, 1) moves the widest place; larger `base` and `tip` make the ends more pointed.
    """
    warped = np.clip(t, 0, 1) ** (np.log(base / (base + tip)) / np.log(widest))
    top = base**base * tip**tip / (base + tip) ** (base + tip)
    return np.asarray(warped**base * (1 - warped) ** tip / top)


def soft_inside(u: NDArray[np.float64], edge: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Alpha (H, W): 1 where |u| < edge, falling over SOFT px of a cell `width` px wide."""
    return np.asarray(np.clip((edge - np.abs(u)) * width / (2 * SOFT) + 0.5, 0, 1))


def ovate(height: int, width: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """A broad leaf (H, W): widest below the middle, an acute tip, a finely toothed edge."""
    u, t = blade_grid(height, width)
    edge = half_width(t, rng.uniform(0.36, 0.5), rng.uniform(0.5, 0.7), rng.uniform(0.7, 0.95))
    teeth = 1 - 0.05 * np.abs(np.sin(t * np.pi * rng.integers(7, 12)))
    return soft_inside(u - 0.12 * rng.uniform(-1, 1) * np.sin(np.pi * t), 0.9 * edge * teeth, width)


def lobed(height: int, width: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """A leaf (H, W) with two to four rounded lobes a side, their sinuses about a third deep."""
    u, t = blade_grid(height, width)
    edge = half_width(t, rng.uniform(0.45, 0.6), 0.55, 0.6)
    n, phase = rng.integers(2, 5), rng.uniform(0.2, 0.5)
    wave = 1 - rng.uniform(0.25, 0.42) * (0.5 + 0.5 * np.cos(2 * np.pi * (n * t - phase - 0.6 * np.abs(u)))) ** 1.5
    return soft_inside(u, 0.95 * edge * wave, width)


def spray(height: int, width: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """A spray of needles (H, W): straight, thin, forward along a shoot, shorter towards the tip."""
    u, t = blade_grid(height, width)
    x, y = u * width / 2, t * height
    alpha = np.clip((0.035 * height * (1 - 0.6 * t) - np.abs(x)) / SOFT + 0.5, 0, 1) * (t < 0.93)
    count = 11
    for side in (-1.0, 1.0):
        for k in range(count):
            foot = (0.02 + 0.8 * (k + rng.uniform(-0.3, 0.3)) / count) * height
            lean = np.deg2rad(rng.uniform(28, 52)) * (1 - 0.35 * k / count)
            along = np.array([side * np.sin(lean), np.cos(lean)])
            reach = min(0.95 * width / 2 / np.sin(lean), 0.42 * height) * (1 - 0.35 * k / count)
            s = np.clip(x * along[0] + (y - foot) * along[1], 0, reach)
            off = np.hypot(x - s * along[0], y - foot - s * along[1])
            alpha = np.maximum(alpha, np.clip((0.03 * height * (1 - 0.5 * s / reach) - off) / SOFT + 0.5, 0, 1))
    return alpha


Form = Literal["ovate", "lobed", "needles"]
FORMS: Mapping[Form, Callable[[int, int, np.random.Generator], NDArray[np.float64]]] = {
    "ovate": ovate,
    "lobed": lobed,
    "needles": spray,
}


def taper(height: int, width: int) -> NDArray[np.float64]:
    """A wide envelope (H, W) that narrows a cut piece to a foot and a tip, as a leaf's outline does."""
    u, t = blade_grid(height, width)
    return soft_inside(u, 1.08 * half_width(t, 0.48, 0.3, 0.34), width)


def veins(height: int, width: int) -> NDArray[np.float64]:
    """Light and shade (H, W) about 1 of a midrib and its side veins: detail finer than a coarse photo holds."""
    u, t = blade_grid(height, width)
    midrib = np.exp(-((u * width / 2 / 1.6) ** 2)) * (1 - 0.6 * t)
    side = np.cos(2 * np.pi * (7 * (t - 0.35 * np.abs(u)))) ** 8 * (1 - np.abs(u))
    return np.asarray(1 + 0.10 * midrib + 0.05 * side - 0.02)
