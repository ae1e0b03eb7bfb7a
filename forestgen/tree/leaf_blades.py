"""Leaf blades as meshes: a trimmed polygon that hugs a cell's alpha, folded along its midrib and curled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.model import vertex_normals

PETIOLE = 0.16  # share of a leaf's length that is petiole
LONG_STALK = 0.48  # and of the long-stalked variant, that reaches farther from its twig
PETIOLE_HALF_WIDTH = 0.015  # of a leaf's length
LEVELS = (0.0, 0.2, 0.5, 0.8, 1.0)  # where along the blade its outline has vertices
HUG = 0.8  # between the mean (0) and the greatest (1) extent of the rows that a level stands for


@dataclass(frozen=True, eq=False)
class Blade:
    """A leaf in leaf space: one long along +Y, petiole included. V vertices, F faces."""

    points: NDArray[np.float64]  # (V, 3)
    normals: NDArray[np.float64]  # (V, 3) unit
    flat: NDArray[np.float64]  # (V, 2) before folding: where in the cell, x in the unit of the length, y in [0, 1]
    faces: NDArray[np.int64]  # (F, 3)


def row_extents(alpha: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Left and right edge (H,) in px from the middle of the columns where alpha (H, W) reaches one half.

    Rows without such a pixel get (0, 0).
    """
    solid = alpha >= 0.5
    width = alpha.shape[1]
    left = solid.argmax(axis=1) - width / 2
    right = width / 2 - solid[:, ::-1].argmax(axis=1)
    empty = ~solid.any(axis=1)
    return np.where(empty, 0.0, left), np.where(empty, 0.0, right)


def trim(alpha: NDArray[np.floating]) -> NDArray[np.float64]:
    """The outline's levels (M, 3) from base to tip: y, left and right in px of the cell (H, W), y upward.

    The petiole's part of the cell is left out.
    """
    height = alpha.shape[0]
    left, right = (side[::-1] for side in row_extents(alpha))  # row 0 below
    rows = np.flatnonzero((right > left) & (np.arange(height) + 0.5 > PETIOLE * height))
    if not len(rows):
        return np.array([[PETIOLE * height, -1, 1], [height, -1, 1]], float)
    low, high = float(rows[0]), float(rows[-1] + 1)
    y = low + (high - low) * np.array(LEVELS)
    border = np.concatenate([[low], (y[1:] + y[:-1]) / 2, [high]])
    levels = []
    for k, at in enumerate(y):
        band = rows[(rows + 1 > border[k]) & (rows < border[k + 1])]
        if k in (0, len(y) - 1):  # the ends: what the first rows span
            band = band[: len(band) // 3 + 1] if k == 0 else band[-(len(band) // 3 + 1) :]
        left_at = (1 - HUG) * left[band].mean() + HUG * left[band].min()
        right_at = (1 - HUG) * right[band].mean() + HUG * right[band].max()
        levels.append([at, left_at, max(right_at, left_at + 1.0)])
    return np.array(levels)


def stalked(flat: NDArray[np.float64], stalk: float) -> NDArray[np.float64]:
    """A flat leaf (V, 2) whose petiole takes another share of the length; the blade keeps its proportions."""
    shrink = (1 - stalk) / (1 - PETIOLE)
    x, y = flat.T
    is_blade = y > PETIOLE
    across = np.where(is_blade & (np.abs(x) > PETIOLE_HALF_WIDTH), x * shrink, x)
    return np.column_stack([across, np.where(is_blade, stalk + (y - PETIOLE) * shrink, y * stalk / PETIOLE)])


def bend(flat: NDArray[np.float64], stalk: float, fold: float, curl: float, twist: float) -> NDArray[np.float64]:
    """Points (V, 3) of a flat leaf (V, 2) with `stalk` of its length petiole.

    Sides are lifted by `fold`, the blade bowed back along an arc of `curl` radians and turned about
    its midrib by `twist` radians at its tip. The foot stays at the origin.
    """
    x, y = flat.T
    share = np.maximum(y - stalk, 0) / (1 - stalk)  # way along the blade
    angle = curl * share
    arc = (1 - stalk) / curl if abs(curl) > 1e-6 else 0.0
    along = np.minimum(y, stalk) + (arc * np.sin(angle) if arc else share * (1 - stalk))
    back = -arc * (1 - np.cos(angle))
    turn = twist * share
    side, lift = x * np.cos(turn) - fold * np.abs(x) * np.sin(turn), x * np.sin(turn) + fold * np.abs(x) * np.cos(turn)
    return np.column_stack([side, along + lift * np.sin(angle), back + lift * np.cos(angle)])


def build_blade(levels: NDArray[np.float64], height: int, stalk: float = PETIOLE, *, rng: np.random.Generator) -> Blade:
    """Mesh a leaf from its outline's levels (M, 3) px of a cell `height` px high; `stalk` of it is petiole.

    Vertices: 3 of the petiole (its foot is a point), 2 on the first and the last level, 3 on each between.
    """
    y, left, right = (levels / height).T
    middle = np.clip(0.0, left + 0.25 * (right - left), right - 0.25 * (right - left))
    reach = y[0] + 0.3 * (y[1] - y[0])  # the petiole runs into the blade
    flat = [[0.0, 0.0], [PETIOLE_HALF_WIDTH, reach], [-PETIOLE_HALF_WIDTH, reach]]
    faces = [[0, 1, 2]]
    flat += [[left[0], y[0]], [right[0], y[0]]]
    for k in range(1, len(levels)):
        a, is_last = len(flat), k == len(levels) - 1
        flat += (
            [[left[k], y[k]], [right[k], y[k]]] if is_last else [[left[k], y[k]], [middle[k], y[k]], [right[k], y[k]]]
        )
        if k == 1:
            b = a - 2
            faces += [[b, a + 1, a], [b, b + 1, a + 1], [b + 1, a + 2, a + 1]]
        elif is_last:
            b = a - 3
            faces += [[b, b + 1, a], [b + 1, a + 1, a], [b + 1, b + 2, a + 1]]
        else:
            b = a - 3
            faces += [[b, b + 1, a + 1], [b, a + 1, a], [b + 1, b + 2, a + 2], [b + 1, a + 2, a + 1]]
    where = np.array(flat)
    bent = (rng.uniform(0.12, 0.4), rng.uniform(0.1, 0.8), rng.uniform(-0.35, 0.35))
    points = bend(stalked(where, stalk), stalk, *bent)
    index = np.array(faces, np.int64)
    return Blade(points, vertex_normals(points, index), where, index)
