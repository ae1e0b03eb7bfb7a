"""Bare or leafy: whether what is in the crown are twigs alone."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.scale import disc
from forestgen.tree.segment.lines import edge_directions
from forestgen.tree.segment.region import Region

LINES = 0.55  # twigs run in one direction: measured 0.65 on bare crowns, 0.35-0.5 on leafy ones of the same detail
SOLID = 0.65  # share of the crown in parts thicker than THICK: measured 0.35-0.4 on bare crowns
THICK = 0.012  # radius of such a part, as a share of the crown's size
ALIKE = 15.0  # difference of median hue (Lab a, b) between crown and stroked wood: 10 on bare crowns
DETAIL = 0.004  # sigma, as a share of the crown's size, of the detail whose direction is looked at


def is_bare_crown(region: Region, is_tree: NDArray[np.bool_], limb: NDArray[np.float32]) -> bool:
    """Whether the tree pixels (h, w) of the crown look like twigs: thin, drawn in lines, coloured like the wood.

    `limb` (h, w) is the cover of the limbs under the branch strokes. All three signs are wanted,
    for a leafy tree taken for bare would lose its leaves.
    """
    crown = is_tree & (region.depth > 0) & (limb < 0.1)
    wood = (limb > 0.9) & ~region.is_inside
    wood = wood if wood.sum() >= 50 else limb > 0.9
    if not crown.any() or not wood.any():
        return False
    thick = cv2.morphologyEx(is_tree.astype(np.uint8), cv2.MORPH_OPEN, disc(THICK * region.size_px))
    if (thick[crown] > 0).mean() > SOLID:
        return False
    lab = cv2.cvtColor(region.rgb, cv2.COLOR_RGB2LAB)[..., 1:]
    apart = np.median(lab[crown], axis=0) - np.median(lab[wood], axis=0)
    return bool(np.linalg.norm(apart) < ALIKE and line_share(region, is_tree, limb) > LINES)


def line_share(region: Region, is_tree: NDArray[np.bool_], limb: NDArray[np.float32]) -> float:
    """How far the mask's edges run in one direction locally: 0 none, 1 parallel lines (structure tensor)."""
    strength, directed = edge_directions(is_tree, max(1.0, DETAIL * region.size_px))
    where = (region.depth > 0) & (limb < 0.1)
    return float(directed[where].sum() / max(strength[where].sum(), 1e-12))
