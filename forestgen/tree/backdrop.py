"""Backdrop: what lies behind a crown, and how much of each of its pixels is leaf before an open sky.

A mixed pixel lies on the straight way from the background's colour to a leaf's. Seen from the local
background, foliage pixels of one kind of leaf lie in one direction, and those that are all leaf lie
farthest out (as haze lines do: Berman et al. 2016, for haze; ours, for mixed pixels). Only where the
background is smooth, as sky is: a hedge or a house is no one colour that could be taken out.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.leaf_colours import split_colours

COLOURS = 6  # of the background, at most
SAMPLES = 60_000  # background pixels that are looked at
CELLS = 72  # of the grid on which the background's colours are spread, across the window's longer side
REACH = ((0.03, 1.0), (0.1, 0.05), (0.4, 0.001))  # (sigma as a share of the window, weight): near samples win
FINE_PX = 2.0  # sigma of what counts as texture
SMOOTH, ROUGH = 0.022, 0.045  # texture, of full scale: from all to nothing is taken out between
FACETS = 6  # a side of each face of the cube whose cells are the directions from the background's colour
PURE = 90  # percentile of the distances in a direction that stands for leaf alone
ENOUGH = 0.8  # of that distance: pixels this far out are all leaf; light and shade reach so far in
FEWEST = 0.001  # share of the pixels that a direction needs to say how far out its leaves lie
NEAREST = 0.5  # no leaf lies nearer to the background than this share of the usual distance
ALIKE, APART = 0.12, 0.25  # distance in RGB [0, 1]: leaves nearer to the background than this cannot be told from it
DARK, BRIGHT = 35.0, 45.0  # CIELAB lightness: shade below the one is taken out nowhere, sky above the other fully
GREEN, YELLOW = (
    -4.0,
    6.0,
)  # CIELAB a* below and b* above which a background could be foliage itself: nothing is taken out


@dataclass(frozen=True, eq=False)
class Backdrop:
    """What lies behind each pixel of a window."""

    rgb: NDArray[np.float32]  # (h, w, 3) in [0, 1]
    smoothness: NDArray[np.float32]  # (h, w) 1 for open sky, 0 for anything with texture


def spread_backdrop(colour: NDArray[np.float32], is_open: NDArray[np.bool_]) -> Backdrop:
    """What lies behind each pixel (h, w): of the background's colours the likeliest there, as it is nearby."""
    h, w = is_open.shape
    size = (max(1, round(w * CELLS / max(h, w))), max(1, round(h * CELLS / max(h, w))))
    rough = np.abs(colour - cv2.GaussianBlur(colour, (0, 0), FINE_PX)).mean(axis=2)
    row, column = np.nonzero(is_open)
    step = max(1, len(row) // SAMPLES)
    row, column = row[step // 2 :: step], column[step // 2 :: step]
    sample = np.column_stack([colour[row, column], rough[row, column]]).astype(float)
    group = split_colours(sample[:, :3], np.ones(len(sample)), COLOURS)
    cell = (row * size[1] // h) * size[0] + column * size[0] // w
    n = size[0] * size[1]

    best = np.full(size[::-1], -1.0, np.float32)
    found = np.zeros((*size[::-1], 4), np.float32)
    for k in range(group.max() + 1):
        pick = group == k
        sums = [np.bincount(cell[pick], weight, n) for weight in (np.ones(pick.sum()), *sample[pick].T)]
        spread = _spread(np.stack(sums, axis=1).reshape(*size[::-1], 5).astype(np.float32))
        likelier = spread[..., 0] > best
        best[likelier] = spread[likelier][:, 0]
        found[likelier] = spread[likelier][:, 1:] / np.maximum(spread[likelier][:, :1], 1e-20)
    full = cv2.resize(found, (w, h), interpolation=cv2.INTER_LINEAR)
    lab = cv2.cvtColor(np.ascontiguousarray(full[..., :3]), cv2.COLOR_RGB2LAB)
    could_be_leaf = np.clip((GREEN - lab[..., 1]) / 4, 0, 1) * np.clip((lab[..., 2] - YELLOW) / 4, 0, 1)
    is_bright = np.clip((lab[..., 0] - DARK) / (BRIGHT - DARK), 0, 1)
    smoothness = np.clip((ROUGH - full[..., 3]) / (ROUGH - SMOOTH), 0, 1) * (1 - could_be_leaf) * is_bright
    return Backdrop(np.asarray(full[..., :3], np.float32), np.asarray(smoothness, np.float32))


def _spread(layers: NDArray[np.float32]) -> NDArray[np.float32]:
    """Layers (a, b, C) blurred by a sum of Gaussians, so that every cell has something and near ones win."""
    out = np.zeros_like(layers)
    for reach, weight in REACH:
        sigma = max(0.6, reach * max(layers.shape[:2]))
        out += np.float32(weight) * cv2.GaussianBlur(layers, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
    return out


def leaf_share(
    colour: NDArray[np.float32], behind: NDArray[np.float32], smoothness: NDArray[np.float32]
) -> NDArray[np.float32]:
    """How much of each foliage pixel (N, 3) before a backdrop (N, 3) is leaf (N,): 1 where that cannot be told."""
    away = colour - behind
    far = np.linalg.norm(away, axis=1)
    trusted = smoothness > 0.5
    if np.count_nonzero(trusted) < 100:
        return np.ones(len(colour), np.float32)
    direction = facet(away)
    count = np.bincount(direction[trusted], minlength=6 * FACETS**2)
    order = np.flatnonzero(trusted)[np.argsort(direction[trusted], kind="stable")]
    reach = np.full(len(count), np.nan)
    for k, member in enumerate(np.split(order, np.cumsum(count)[:-1])):
        if len(member) > max(30.0, FEWEST * len(order)):
            reach[k] = np.percentile(far[member], PURE)
    known = np.isfinite(reach)
    if not known.any():
        return np.ones(len(colour), np.float32)
    usual = float(np.average(reach[known], weights=count[known]))
    reach = np.maximum(np.where(known, reach, usual), NEAREST * usual)
    share = np.minimum(1, far / (ENOUGH * reach[direction]))
    told = np.clip((reach[direction] - ALIKE) / (APART - ALIKE), 0, 1) * smoothness
    return np.asarray(1 - (1 - share) * told, np.float32)


def facet(away: NDArray[np.float32]) -> NDArray[np.int64]:
    """Which cell of a cube's faces each vector (N, 3) points to (N,), in [0, 6 FACETS^2)."""
    size = np.abs(away)
    axis = size.argmax(axis=1)
    index = np.arange(len(away))
    longest = away[index, axis]
    scale = np.maximum(np.abs(longest), 1e-6)
    u, v = (
        np.clip(((away[index, (axis + k) % 3] / scale + 1) / 2 * FACETS).astype(np.int64), 0, FACETS - 1)
        for k in (1, 2)
    )
    return np.asarray(((2 * axis + (longest > 0)) * FACETS + u) * FACETS + v)
