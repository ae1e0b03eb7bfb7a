"""How long a leaf should be, measured from the matte: the finest detail that it must be able to draw."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.leaf_colours import lab_of
from forestgen.tree.scale import disc
from forestgen.tree.view import View

LOST = 0.12  # share of the foliage that an opening may take away before its disc counts as too coarse
LENGTHS = 4.5  # a leaf is about this many times as long as the radius of its widest place
COARSEST_DISC = 8  # px; detail coarser than this says nothing about leaves
SHORTEST, LONGEST = 0.011, 0.018  # share of the tree's height that a leaf may be long
TRUNK_REACH = 0.78  # share of the height that a conifer's trunk stroke reaches
CROWN_SLIM = 1.3  # height over width of a conifer's crown
WARM = 3.0  # CIELAB a* above which foliage is autumn's or a flower's


def detail_radius(is_foliage: NDArray[np.bool_]) -> float:
    """The radius in px of the disc whose opening takes 12 % of the foliage (H, W) away.

    Small for lacy crowns, large for dense ones; between whole pixels it is interpolated.
    """
    rows, columns = np.nonzero(is_foliage)
    if not len(rows):
        return 0.0
    part = is_foliage[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    mask = cv2.copyMakeBorder(part.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT)
    before = 0.0
    for radius in range(1, COARSEST_DISC + 1):
        lost = 1 - np.count_nonzero(cv2.morphologyEx(mask, cv2.MORPH_OPEN, disc(radius))) / len(rows)
        if lost >= LOST:
            return radius - 1 + (LOST - before) / (lost - before)
        before = lost
    return float(COARSEST_DISC)


def height_px(view: View) -> float:
    """How tall the tree is in its photo, px: from the root's row to the highest foliage or branch pixel."""
    rows = np.flatnonzero(view.mattes.is_tree.any(axis=1))
    return max(1.0, view.camera.root_px[1] - float(rows[0])) if len(rows) else 1.0


def leaf_length_px(view: View) -> float:
    """How long a leaf should be in this photo, px."""
    tall = height_px(view)
    return float(np.clip(LENGTHS * detail_radius(view.mattes.is_foliage), SHORTEST * tall, LONGEST * tall))


def bears_needles(view: View) -> bool:
    """Whether a tree looks like a conifer: its trunk is drawn to the top of a crown taller than wide, not warm in hue.

    Measured, not guessed from the texture: at photo scale neither the matte's outline (slenderness of
    what an opening removes: 1.9-2.4 for firs, oaks and maples alike) nor the light's structure tensor
    (coherence 0.43-0.58 for both) tells needles from leaves. The trunk's reach does: 0.76-0.98 of the
    height in conifers, 0.47-0.79 in the others, whose crowns are as wide as tall where it is above 0.75.
    """
    tall = height_px(view)
    crown = view.strokes.crown
    reach = (view.camera.root_px[1] - view.strokes.branches[0][:, 1].min()) / tall
    slim = np.ptp(crown[:, 1]) / max(1.0, float(np.ptp(crown[:, 0])))
    lab = lab_of(view.photo.rgb[view.mattes.is_foliage])
    return bool(reach >= TRUNK_REACH and slim >= CROWN_SLIM and lab[:, 1].mean() <= WARM)


def leaf_length(views: Sequence[View]) -> float:
    """How long a leaf should be, metres: the shortest that any view with foliage asks for."""
    lengths = [leaf_length_px(view) / view.camera.px_per_metre for view in views if not view.mattes.is_bare]
    return min(lengths, default=0.0)
