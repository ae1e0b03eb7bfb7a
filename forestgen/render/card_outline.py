"""A tree's outlines from a dozen sides: what of it reaches furthest out, and where cards reach beyond them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.camera import Camera
from forestgen.render.outline_kernels import foremost, mark
from forestgen.tree.lod_outline import CLOSING, SIDES
from forestgen.tree.scale import disc

CELLS = 400  # of the silhouettes, along the tree's height
ROOM = 4  # empty cells around
STRETCH = 0.01  # of the height: along so much of an outline the foremost thing is enough
REACH = 0.012  # of the height: what lies deeper below the outline does not draw it


@dataclass(frozen=True, eq=False)
class Outlines:
    """The silhouettes of a tree from S sides on W x W cells, their gaps closed and their holes filled."""

    middle: NDArray[np.float64]  # (3,) m, what falls on the middle of the cells
    cells_per_metre: float
    beyond: NDArray[np.float32]  # (S, W, W) how many cells each lies outside, below 0 where it lies inside

    def __post_init__(self) -> None:
        freeze(self, middle=(np.float64, 3), beyond=(np.float32, "S", "W", "W"))

    def farthest_beyond(self, corner: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float32]:
        """How many metres (H, W) texels of a card lie beyond the outline of that side where this is most.

        The card's texels, `size` (W, H), have their middles at corner[0] + x (corner[1] - corner[0]) +
        y (corner[2] - corner[0]), with corners (3, 3) in metres.
        """
        most = np.full(size[::-1], -np.inf, np.float32)
        for side, beyond in enumerate(self.beyond):
            cell = _camera(side, beyond.shape[0], self.cells_per_metre).project(corner - self.middle) - 0.5
            way = np.column_stack([cell[1] - cell[0], cell[2] - cell[0], cell[0]])
            flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
            np.maximum(most, cv2.warpAffine(beyond, way, size, flags=flags, borderMode=cv2.BORDER_REPLICATE), out=most)
        return np.asarray(most / self.cells_per_metre, np.float32)


def outlines_of(
    points: NDArray[np.float64], owner: NDArray[np.int64], height: float
) -> tuple[Outlines, NDArray[np.int64]]:
    """The outlines of a tree, `height` metres tall, of points (N, 3), and how much of them hangs on each thing.

    Points belong to things `owner` (N,), or to none of interest where that is -1. The second answer (M,) counts the
    stretches of outlines along which a thing is the foremost.
    """
    along = np.ascontiguousarray(points.T, np.float32)
    low, high = along.min(axis=1), along.max(axis=1)
    middle, scale = (low + high) / 2, CELLS / max(height, 1e-6)
    along -= middle[:, None]
    width = int(np.ceil(np.linalg.norm(high - low) * scale + 2 * CLOSING * CELLS)) + 2 * ROOM
    beyond = np.empty((len(SIDES), width, width), np.float32)
    leads = np.zeros(int(owner.max(initial=-1)) + 1, np.int64)
    cell = np.zeros(len(points), np.int32)
    for side in range(len(SIDES)):
        axes = (_camera(side, width, scale).axes[:2] * [[scale], [-scale]]).astype(np.float32)
        mask = np.zeros((width, width), np.uint8)
        mark(axes[0] @ along, axes[1] @ along, width, cell, mask.reshape(-1))
        inside = _silhouette(mask)
        depth, label = cv2.distanceTransformWithLabels(
            inside, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
        )
        beyond[side] = cv2.distanceTransform(1 - inside, cv2.DIST_L2, cv2.DIST_MASK_5) - depth
        leading = foremost(cell, owner, depth, label, np.float32(REACH * CELLS), round(STRETCH * CELLS))
        leads[np.unique(leading[leading >= 0])] += 1
    beyond.setflags(write=False)  # kept without a copy
    return Outlines(middle, scale, beyond), leads


def _camera(side: int, width: int, cells_per_metre: float) -> Camera:
    """Sees a side in cells."""
    return Camera((width, width), (width / 2, width / 2), cells_per_metre, *SIDES[side])


def _silhouette(mask: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """1 in the cells (W, W) of a mask and what lies between them, 0 around."""
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, disc(CLOSING * CELLS))
    around = closed.copy()
    cv2.floodFill(around, None, (0, 0), 2)  # what is around reaches the corner: there is room
    return np.asarray(around != 2, np.uint8)
