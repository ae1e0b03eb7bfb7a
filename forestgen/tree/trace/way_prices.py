"""Way prices: what a length of one pixel costs a way, on wood, behind leaves, before open background."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.trace.wood_model import WoodModel

BESIDE = 1.0  # how much dearer the rim of a limb is than its middle, as a share
LIMB_CELLS = 15  # as wide as a limb is, in cells: its middle is looked for within them
AROUND = 0.05  # of the tree's height: no way leaves the box of the strokes by more
RIM = 1.5  # how much dearer leaves on the outline are than those well inside, as a share: no way runs along it
RIM_DEPTH = 0.03  # of the tree's height: how deep that reaches


@dataclass(frozen=True, eq=False)
class PriceMap:
    """Prices on a grid that is `factor` times coarser than the photo. h x w cells."""

    price: NDArray[np.float64]  # (h, w)
    distance: NDArray[np.float32]  # (h, w) to the wood's edge, in cells; 0 off the wood
    factor: float  # px a cell

    def cell(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Flat indices (K,) of the cells that hold points (K, 2) px."""
        height, width = self.price.shape
        column, row = np.clip((points / self.factor).astype(np.int64), 0, [width - 1, height - 1]).T
        return np.asarray(row * width + column)

    def place(self, cell: NDArray[np.int64]) -> NDArray[np.float64]:
        """Middles (K, 2) px of cells (K,)."""
        row, column = np.divmod(cell, self.price.shape[1])
        return np.asarray((np.column_stack([column, row]) + 0.5) * self.factor)


def price_map(
    model: WoodModel,
    is_stroke: NDArray[np.bool_],
    drawn: NDArray[np.float64],
    tall_px: float,
    cells: int,
    *,
    wood: float,
    leaf: float,
    sky: float,
) -> PriceMap:
    """Prices on a grid in which the tree is about `cells` high; a stroke costs as much as wood.

    They are infinite, no way leads there, farther than a margin out of the box of what is drawn (K, 2) px.
    """
    factor = max(tall_px / cells, 1.0)
    size = tuple(max(1, round(side / factor)) for side in model.wood.shape[::-1])

    def coarse(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
        return np.asarray(cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA))

    distance = cv2.resize(model.distance, size, interpolation=cv2.INTER_AREA) / np.float32(factor)
    is_wood = coarse(model.wood) > 0.25
    widest = cv2.dilate(distance, np.ones((LIMB_CELLS, LIMB_CELLS), np.uint8))
    on_wood = wood * (1 + BESIDE * (1 - distance / np.maximum(widest, 1e-6)))
    covered = coarse(model.is_covered)
    depth = cv2.distanceTransform(np.pad((covered > 0.5).astype(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
    rim = np.clip(1 - depth / (RIM_DEPTH * tall_px / factor), 0, 1)
    price = leaf * (1 + RIM * rim) * covered + sky * (1 - covered)
    price = np.where(is_wood, np.minimum(on_wood, price), price)
    price = np.where(coarse(is_stroke) > 0.1, np.minimum(wood, price), price)
    low = np.maximum((drawn.min(axis=0) - AROUND * tall_px) / factor, 0).astype(int)
    high = np.ceil((drawn.max(axis=0) + AROUND * tall_px) / factor).astype(int)
    box = np.full(price.shape, np.inf)
    box[low[1] : high[1], low[0] : high[0]] = 0
    price = price + box
    return PriceMap(price.astype(np.float64), np.asarray(distance * is_wood, np.float32), factor)
