"""Neighbours: trunks of other trees that stand in the crown's outline, beside or behind it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.segment.region import Region
from forestgen.tree.segment.wood import Limbs

LONG = 0.15  # of the crown's size: shorter patches of wood are no trunk
UPRIGHT = np.deg2rad(30)  # from the vertical, at most
FOOT = 0.15  # of a patch's height: its lower end
CUT = 0.5  # of the foot's lowest rows must lie at the outline, where the patch is cut off
EDGE = 0.02  # of the crown's size: how near to the outline that is
IN_LINE = 1.2  # half-widths of a trunk from its axis: what stands there is a part of it, seen through leaves
AS_THICK = 0.7  # the foot's width over that of the whole: trunks come in thick, twigs leave thin


def without_neighbours(
    region: Region, is_tree: NDArray[np.bool_], is_wood: NDArray[np.bool_], limbs: Limbs
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """What is tree and what is wood (h, w), but for the trunks of neighbours."""
    own = ~neighbours_trunks(region, is_wood, limbs)
    return is_tree & own, is_wood & own


def neighbours_trunks(region: Region, is_wood: NDArray[np.bool_], limbs: Limbs) -> NDArray[np.bool_]:
    """Pixels (h, w) of the wood that belong to a neighbour's trunk.

    Such a patch hangs together with none of the stroked limbs, stands upright, and comes in from below over the
    crown's outline as thick as it is; what stands in its line belongs to it. A tree's own stems come together
    below the crown.
    """
    n, label, stats, _ = cv2.connectedComponentsWithStats((is_wood | limbs.is_limb).astype(np.uint8), connectivity=8)
    is_other = np.ones(n, bool)
    is_other[[0, *np.unique(label[limbs.is_limb]).tolist()]] = False
    rim = region.depth[region.is_inside].min(initial=0.0) + EDGE * region.size_px
    found = np.zeros_like(is_wood)
    for patch in np.flatnonzero(is_other & (stats[:, cv2.CC_STAT_HEIGHT] >= LONG * region.size_px)).tolist():
        row, column = np.nonzero(label == patch)
        axis = np.linalg.eigh(np.cov(np.stack([column, row]).astype(float)))[1][:, -1]
        is_upright = abs(axis[0]) <= np.sin(UPRIGHT)
        if is_upright and _comes_in_from_below(row, region.depth[row, column] <= rim):
            found |= is_other[label] & _in_line(label.shape, row, column, axis)
    return found & is_wood


def _in_line(
    shape: tuple[int, ...], row: NDArray[np.int64], column: NDArray[np.int64], axis: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which pixels (h, w) lie in the line of a patch (N,) that runs along an axis (x, y)."""
    off = (np.arange(shape[1]) - column.mean()) * axis[1] - (np.arange(shape[0])[:, None] - row.mean()) * axis[0]
    return np.asarray(np.abs(off) <= IN_LINE * np.abs(off[row, column]).max())


def _comes_in_from_below(row: NDArray[np.int64], at_rim: NDArray[np.bool_]) -> bool:
    """Whether pixels (N,) of a patch are cut off at its lower end, and there as wide as the patch."""
    low = row >= row.max() - FOOT * (row.max() - row.min())
    n_rows, n_low = len(np.unique(row)), len(np.unique(row[low]))
    lowest = row >= row.max() - max(1.0, EDGE * (row.max() - row.min()))
    is_thick = np.count_nonzero(low) / n_low >= AS_THICK * len(row) / n_rows
    return bool(is_thick and at_rim[lowest].mean() >= CUT)
