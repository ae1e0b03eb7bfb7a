"""Bare or leafy: whether what is in the crown are twigs alone."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.scale import disc
from forestgen.tree.segment.lines import edge_directions
from forestgen.tree.segment.region import Region

LINES, LINES_IF_SOLID = 0.42, 0.35  # how far a bare crown's edges run one way, and by how much more where it is solid
THICK = 0.012  # radius of a part that counts as solid, as a share of the crown's size
ALIKE = 15.0  # difference of median hue (Lab a, b) between crown and stroked wood below which they are alike
DETAIL = 0.004  # sigma, as a share of the crown's size, of the detail whose direction is looked at


def is_bare_crown(region: Region, is_tree: NDArray[np.bool_], limb: NDArray[np.float32]) -> bool:
    """Whether the tree pixels (h, w) of the crown look like twigs: drawn in lines, and coloured like the wood.

    `limb` (h, w) is the cover of the limbs under the branch strokes. Measured: bare crowns have a
    line share of 0.65 with a solid share of 0.35-0.4 and a hue 10 from their wood's; leafy ones
    0.35-0.5, up to 0.65 where the photo is so coarse that all is solid. The line between runs
    midway; a leafy tree taken for bare would lose its leaves, so the hue must agree as well.
    """
    crown = is_tree & (region.depth > 0) & (limb < 0.1)
    wood = (limb > 0.9) & ~region.is_inside
    wood = wood if wood.sum() >= 50 else limb > 0.9
    if not crown.any() or not wood.any():
        return False
    lab = cv2.cvtColor(region.rgb, cv2.COLOR_RGB2LAB)[..., 1:]
    apart = np.median(lab[crown], axis=0) - np.median(lab[wood], axis=0)
    solid = cv2.morphologyEx(is_tree.astype(np.uint8), cv2.MORPH_OPEN, disc(THICK * region.size_px))
    enough = LINES + LINES_IF_SOLID * (solid[crown] > 0).mean()
    return bool(np.linalg.norm(apart) < ALIKE and line_share(region, is_tree, limb) > enough)


def line_share(region: Region, is_tree: NDArray[np.bool_], limb: NDArray[np.float32]) -> float:
    """How far the edges of the crown's mask run in one direction locally: 0 none, 1 parallel lines."""
    strength, directed = edge_directions(is_tree, max(1.0, DETAIL * region.size_px))
    where = (region.depth > 0) & (limb < 0.1)
    return float(directed[where].sum() / max(strength[where].sum(), 1e-12))
