"""Pieces of foliage in a photo that look like leaves: found by their light, grouped to span the colours."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.foliage_unmixing import PureFoliage
from forestgen.tree.leaf_colours import lab_of, split_colours
from forestgen.tree.view import View

BASIN = 0.13  # blur before the search for lights, as a share of a piece's length: sets the spacing of the basins
OPAQUE = 0.9  # matte from which a pixel's colour is the leaf's own
PURE = 0.6  # share of leaf in a pixel from which it may be cut out; what it lacks is made up from its own colour
WELL_COVERED = 0.85  # share of a piece's pixels that should be opaque
NEAR_COLOUR = 6.0  # CIELAB distance that makes a piece unlike its group
SLIM = 1.9  # how much longer than wide a good piece is


@dataclass(frozen=True, eq=False)
class Pieces:
    """P pieces of one photo. Pixels are those of `window`, a part of the photo."""

    rgb: NDArray[np.uint8]  # (H, W, 3) the part of the photo
    label: NDArray[np.int32]  # (H, W) piece of each pixel, -1 outside the foliage
    is_opaque: NDArray[np.bool_]  # (H, W) whether the pixel's colour is the leaf's own
    centre: NDArray[np.float64]  # (P, 2) xy px
    axis: NDArray[np.float64]  # (P, 2) unit, along the piece, away from the crown's middle
    length: NDArray[np.float64]  # (P,) px
    width: NDArray[np.float64]  # (P,) px
    area: NDArray[np.float64]  # (P,) px
    lab: NDArray[np.float64]  # (P, 3) mean CIELAB of its pixels, weighted by the matte
    score: NDArray[np.float64]  # (P,) how leaf-like, in [0, 1]

    def __len__(self) -> int:
        return len(self.area)


def climb(height: NDArray[np.float32], inside: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Basins of attraction: label (H, W) of the summit that steepest ascent from each pixel reaches; -1 outside.

    Every pixel points to the highest of its 3 x 3 neighbours inside; pointers are doubled until they rest.
    """
    h, w = height.shape
    wide = np.pad(np.where(inside, height, -np.inf), 1, constant_values=-np.inf)
    best, target = wide[1:-1, 1:-1].copy(), np.arange(h * w, dtype=np.int32).reshape(h, w)
    index = np.pad(target, 1)
    for dy, dx in [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)]:
        near = wide[1 + dy : 1 + dy + h, 1 + dx : 1 + dx + w]
        higher = near > best
        best[higher] = near[higher]
        target[higher] = index[1 + dy : 1 + dy + h, 1 + dx : 1 + dx + w][higher]
    up = target.ravel()[np.flatnonzero(inside)]
    full = target.ravel()
    while not np.array_equal(full[up], up):
        full = full[full]
        up = full[np.flatnonzero(inside)]
    label = np.full(h * w, -1, np.int32)
    label[np.flatnonzero(inside)] = np.unique(up, return_inverse=True)[1]
    return label.reshape(h, w)


def find_pieces(view: View, pure: PureFoliage, length_px: float) -> Pieces:
    """Cut the foliage of a view into pieces about `length_px` long, each around one light."""
    is_foliage = view.mattes.is_foliage
    rows, columns = np.nonzero(is_foliage)
    margin = int(np.ceil(length_px))
    top, left = max(0, rows.min() - margin), max(0, columns.min() - margin)
    part = (slice(top, rows.max() + margin + 1), slice(left, columns.max() + margin + 1))
    rgb, inside = pure.rgb[part], is_foliage[part]
    matte = view.mattes.foliage[part] * pure.share[part]
    is_own = (view.mattes.foliage[part] >= OPAQUE) & (pure.share[part] >= PURE)
    is_opaque = cv2.erode(is_own.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0

    lab = lab_of(rgb)
    weight = inside.astype(np.float32)
    sigma = max(0.8, BASIN * length_px)
    share = np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-3)
    light = cv2.GaussianBlur(lab[..., 0] * weight, (0, 0), sigma) / share
    light *= np.sqrt(np.minimum(1.0, share))  # on flat ground the middle of a patch is its summit
    label = climb(light.astype(np.float32), inside)
    return _describe(rgb, lab, label, matte, is_opaque, length_px)


def _describe(
    rgb: NDArray[np.uint8],
    lab: NDArray[np.float32],
    label: NDArray[np.int32],
    matte: NDArray[np.float32],
    is_opaque: NDArray[np.bool_],
    length_px: float,
) -> Pieces:
    y, x = np.nonzero(label >= 0)
    of = label[y, x]
    n = int(of.max()) + 1

    def mean(value: NDArray[np.floating] | NDArray[np.bool_]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(of, value, n) / area)

    area = np.bincount(of, minlength=n).astype(float)
    centre = np.column_stack([mean(x + 0.5), mean(y + 0.5)])
    dx, dy = x + 0.5 - centre[of, 0], y + 0.5 - centre[of, 1]
    xx, xy, yy = mean(dx * dx) + 1 / 12, mean(dx * dy), mean(dy * dy) + 1 / 12
    half_trace, half_gap = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    major, minor = np.sqrt(half_trace + half_gap), np.sqrt(np.maximum(half_trace - half_gap, 1 / 12))
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    axis = np.column_stack([np.cos(angle), np.sin(angle)])
    middle = np.array([np.median(x), np.percentile(y, 75)])  # leaves point away from the lower middle of the crown
    axis *= np.where(np.sum(axis * (centre - middle), axis=1) < 0, -1.0, 1.0)[:, None]

    weight = matte[y, x]
    total = np.bincount(of, weight, n)
    gradient = np.hypot(cv2.Sobel(lab[..., 0], cv2.CV_32F, 1, 0), cv2.Sobel(lab[..., 0], cv2.CV_32F, 0, 1))
    sharp = mean(gradient[y, x])
    compact = area / (4 * np.pi * major * minor)  # 1 for an ellipse
    slim = major / minor
    usual = 0.35 * length_px**2  # area of a leaf of that length
    score = (
        np.clip(mean(is_opaque[y, x]) / WELL_COVERED, 0, 1) ** 2
        * np.exp(-(np.log(np.maximum(area, 1) / usual) ** 2))
        * np.exp(-(np.log(slim / SLIM) ** 2) * 2)
        * np.clip(compact, 0, 1) ** 4
        * (0.3 + 0.7 * np.clip(sharp / (np.percentile(sharp, 80) + 1e-9), 0, 1))
    )
    return Pieces(
        rgb=rgb,
        label=label,
        is_opaque=is_opaque,
        centre=centre,
        axis=axis,
        length=4 * major,
        width=4 * minor,
        area=area,
        lab=np.column_stack([np.bincount(of, lab[y, x, c] * weight, n) / total for c in range(3)]),
        score=score,
    )


def group_colours(pieces: Pieces, n: int) -> NDArray[np.float64]:
    """Mean colours (K, 3) CIELAB of at most n groups that span the crown's colours and lights."""
    group = split_colours(pieces.lab, pieces.area, min(n, len(pieces)))
    return np.array(
        [np.average(pieces.lab[group == k], axis=0, weights=pieces.area[group == k]) for k in range(group.max() + 1)]
    )


def rank_pieces(pieces: Pieces, colour: NDArray[np.float64], n: int) -> NDArray[np.int64]:
    """For each colour (K, 3) the n most leaf-like pieces near it (K, n), best first."""
    far = np.linalg.norm(pieces.lab[:, None] - colour, axis=2)
    worth = pieces.score[:, None] * np.exp(-((far / NEAR_COLOUR) ** 2)) + 1e-9 / (1 + far)
    return np.argsort(-worth, axis=0, kind="stable")[:n].T
