"""Wood model: the branch matte made ready for tracing, once for a photo."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.mattes import Mattes
from forestgen.tree.trace.half_width import edge_distance


@dataclass(frozen=True, eq=False)
class WoodModel:
    """What is prepared once for a photo's mattes, so that strokes are traced at once."""

    wood: NDArray[np.bool_]  # (H, W) visible wood
    distance: NDArray[np.float32]  # (H, W) px of each wood pixel to the wood's edge
    is_foliage: NDArray[np.bool_]  # (H, W)
    is_covered: NDArray[np.bool_]  # (H, W) leaf or wood, a little widened: a hidden branch may pass here

    def __post_init__(self) -> None:
        freeze(
            self,
            wood=(np.bool_, "H", "W"),
            distance=(np.float32, "H", "W"),
            is_foliage=(np.bool_, "H", "W"),
            is_covered=(np.bool_, "H", "W"),
        )


def wood_model(mattes: Mattes, least_px: int, leaf_px: float) -> WoodModel:
    """Clean the branch matte of specks below `least_px` pixels and of leaves up to `leaf_px` before a limb."""
    wood = behind_leaves(without_specks(mattes.is_branch, least_px), mattes.is_foliage, leaf_px)
    near = cv2.dilate((mattes.is_tree | wood).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    return WoodModel(wood, edge_distance(wood), mattes.is_foliage, near)


def without_specks(wood: NDArray[np.bool_], least_px: int) -> NDArray[np.bool_]:
    """A mask (H, W) without parts of fewer pixels, and without pinholes: leaf or noise, not a fork."""
    _, label, stats, _ = cv2.connectedComponentsWithStats(wood.astype(np.uint8), connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= least_px
    large[0] = False
    kept = large[label]
    _, label, stats, _ = cv2.connectedComponentsWithStats((~kept).astype(np.uint8), connectivity=4)
    pinhole = stats[:, cv2.CC_STAT_AREA] <= 4
    pinhole[0] = False
    return np.asarray(kept | pinhole[label])


def behind_leaves(wood: NDArray[np.bool_], is_foliage: NDArray[np.bool_], most_px: float) -> NDArray[np.bool_]:
    """The mask (H, W) with what lies behind leaves all around which wood is seen, up to an area in px."""
    _, label, stats, _ = cv2.connectedComponentsWithStats((~wood).astype(np.uint8), connectivity=4)
    leafy = np.bincount(label[is_foliage], minlength=len(stats))
    hole = (stats[:, cv2.CC_STAT_AREA] <= most_px) & (leafy > 0.5 * stats[:, cv2.CC_STAT_AREA])
    hole[0] = False
    return np.asarray(wood | hole[label])
