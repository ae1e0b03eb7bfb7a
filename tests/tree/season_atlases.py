"""Atlases of painted leaves with known colours, for the tests of seasons, light and mips."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.atlas_packing import bleed
from forestgen.tree.leaf_colours import lab_of
from forestgen.tree.model import Atlas, LeafPrototype

CELL = 64  # px
GREEN, ORANGE, PINK = (36.0, -16.0, 28.0), (45.0, 24.0, 40.0), (66.0, 13.0, 6.0)


def painted_atlas(colours: Sequence[tuple[float, float, float]], *, twice: bool = False) -> Atlas:
    """One elliptic leaf a colour (CIELAB) in a row of cells, light above and dark below, with stripes for veins.

    With `twice` each cell is worn by two prototypes, as long-stalked leaves do.
    """
    n = len(colours)
    y, x = (np.mgrid[:CELL, :CELL] + 0.5) / CELL * 2 - 1
    alpha = np.clip((0.85 - np.hypot(x / 0.75, y)) * CELL / 4 + 0.5, 0, 1)
    rgba = np.zeros((CELL, CELL * n, 4), np.uint8)
    for k, lab in enumerate(colours):
        tall = np.broadcast_to(np.array(lab, np.float32), (CELL, CELL, 3)).copy()
        tall[..., 0] *= 1 - 0.25 * y + 0.08 * np.sin(18 * (x + y))
        rgb = np.clip(cv2.cvtColor(tall.astype(np.float32), cv2.COLOR_LAB2RGB), 0, 1)
        rgba[:, k * CELL : (k + 1) * CELL] = np.round(255 * np.dstack([rgb, alpha]))
    prototypes = tuple(_prototype(k, n) for k in range(n))
    return Atlas(bleed(rgba), prototypes * (2 if twice else 1))


def _prototype(k: int, n: int) -> LeafPrototype:
    corners = np.array([[0.1, 0.05], [0.9, 0.05], [0.9, 0.95], [0.1, 0.95]])
    return LeafPrototype(
        points=np.column_stack([corners - [0.5, 0], np.zeros(4)]),
        normals=np.tile([0.0, 0.0, 1.0], (4, 1)),
        uv=np.column_stack([(k + corners[:, 0]) / n, corners[:, 1]]),
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
        colour=np.array([0.3, 0.5, 0.2]),
        length_px=20.0,
    )


def cell_lab(rgba: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Mean CIELAB (K, 3) of each cell's opaque texels."""
    lab = lab_of(rgba[..., :3])
    cells = np.split(np.arange(rgba.shape[1]), rgba.shape[1] // CELL)
    return np.array([lab[:, c][rgba[:, c, 3] == 255].mean(axis=0) for c in cells])


def hue(lab: NDArray[np.floating]) -> NDArray[np.float64]:
    """CIELAB hue in degrees, [0, 360)."""
    return np.asarray(np.degrees(np.arctan2(lab[..., 2], lab[..., 1])) % 360)
