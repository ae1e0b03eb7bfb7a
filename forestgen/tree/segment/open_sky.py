"""Open sky: gaps between needles and petals, too small for the cut, taken out of the matte of the leaves."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.backdrop import leaf_share, spread_backdrop
from forestgen.tree.segment.region import Region
from forestgen.tree.segment.soft_edge import FLECK, without_flecks, without_strays

AT_HALF = 0.33  # measured: the share of the farthest colour at which a pixel is half covered; shaded leaves lie nearer
CLEAR = 0.05  # alpha below which a pixel shows what is behind
APART = 5  # px: so far from the tree nothing of it is mixed in
ROUNDS = 2  # the gaps found first tell better what is behind the crown


def without_sky(region: Region, leaf: NDArray[np.float32], wood: NDArray[np.float32]) -> NDArray[np.float32]:
    """The leaves' alpha (h, w); before open sky it is no more than each pixel's share of leaf.

    The cut keeps sky within a tuft, since each of its pixels is mixed with leaf colours and has
    leaves for neighbours. Before textured background, or where leaves are coloured like it, nothing changes.
    """
    block = np.ones((APART, APART), np.uint8)
    for _ in range(ROUNDS):
        tree = np.where(leaf >= 0.5, leaf, 0) + wood
        is_behind = cv2.erode((tree < CLEAR).astype(np.uint8), block) > 0
        is_leaf = leaf > 0
        if not is_behind.any() or not is_leaf.any():
            break
        behind = spread_backdrop(region.rgb, is_behind)
        share = leaf_share(region.rgb[is_leaf], behind.rgb[is_leaf], behind.smoothness[is_leaf])
        leaf = leaf.copy()
        leaf[is_leaf] = np.minimum(leaf[is_leaf], share * np.float32(0.5 / AT_HALF))
    kept = without_strays(without_flecks(leaf + wood, FLECK * region.size_px**2), region.size_px)
    return np.where(kept > 0, leaf, np.float32(0))
