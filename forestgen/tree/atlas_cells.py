"""The cells of a leaf atlas: which texels belong to which leaf."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.atlas_packing import SOLID
from forestgen.tree.model import Atlas


@dataclass(frozen=True, eq=False)
class Cells:
    """The solid texels of an atlas, N of them in K cells; the colour of all others is bled from these."""

    row: NDArray[np.int64]  # (N,)
    column: NDArray[np.int64]  # (N,)
    of: NDArray[np.int64]  # (N,) cell of each
    n: int  # K

    def mean(self, value: NDArray[np.floating]) -> NDArray[np.float64]:
        """Mean (K, C) over each cell of a value (N, C)."""
        count = np.maximum(np.bincount(self.of, minlength=self.n), 1)
        sums = [np.bincount(self.of, value[:, c], self.n) for c in range(value.shape[1])]
        return np.column_stack(sums) / count[:, None]


def find_cells(atlas: Atlas) -> Cells:
    """Each solid texel falls to the cell whose box is nearest; several prototypes may wear one cell."""
    boxes = cell_boxes(atlas)
    row, column = np.nonzero(atlas.rgba[..., 3] >= SOLID * 255)
    nearest = np.full(len(row), np.inf)
    of = np.zeros(len(row), np.int64)
    for k, (left, top, right, bottom) in enumerate(boxes):
        across = np.maximum(np.maximum(left - column - 0.5, column + 0.5 - right), 0)
        down = np.maximum(np.maximum(top - row - 0.5, row + 0.5 - bottom), 0)
        far = across * across + down * down
        closer = far < nearest
        nearest[closer], of[closer] = far[closer], k
    return Cells(row, column, of, len(boxes))


def cell_boxes(atlas: Atlas) -> NDArray[np.float64]:
    """Boxes (K, 4) left, top, right, bottom in px around the uv of prototypes; those that overlap wear one cell."""
    height, width = atlas.rgba.shape[:2]
    found: list[NDArray[np.float64]] = []
    for prototype in atlas.prototypes:
        u, v = prototype.uv.T
        box = np.array([u.min() * width, (1 - v.max()) * height, u.max() * width, (1 - v.min()) * height])
        for k, other in enumerate(found):
            if np.all(np.minimum(box, other)[2:] > np.maximum(box, other)[:2]):
                found[k] = np.concatenate([np.minimum(box, other)[:2], np.maximum(box, other)[2:]])
                break
        else:
            found.append(box)
    return np.array(found).reshape(-1, 4)
