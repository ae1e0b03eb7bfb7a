"""The foliage's own colour: the sky that shows through between needles and petals taken out of a photo's pixels.

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
from forestgen.tree.view import View

OPEN = 0.05  # matte below which a pixel is background
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
LEAST = 0.35  # share of leaf below which a pixel does not say its leaf's colour by itself
SPREAD = 3.0  # px of a picture COARSER times smaller: sigma from where such pixels take it
COARSER = 4
DARK, BRIGHT = 35.0, 45.0  # CIELAB lightness: shade below the one is taken out nowhere, sky above the other fully
GREEN, YELLOW = (
    -4.0,
    6.0,
)  # CIELAB a* below and b* above which a background could be foliage itself: nothing is taken out
AIR = 0.9  # share of the light between leaves, and of its colour, that leaves take on
SKY = 0.1  # share of the foliage before open sky from which the sky's tint is taken out
HUE = 8.0  # CIELAB chroma from which a sky tints
PLAIN = 45  # percentile of the tint below which foliage is plain
PLAIN_MOST = 95  # percentile of the plain foliage's tint that any leaf may have, in proportion to its light
TAKEN = 0.9  # share of what is beyond that which is taken out
LEAN = 0.2  # and share of the plain foliage's hue put in its stead
ACROSS = 0.6  # share of the plain foliage's hue across the sky's that comes with it: no green turns purple
BOUND = 3.2  # CIEDE2000 or so: how far from the photo the mean pixel of a crown may be taken
HALF_TURNED = 3.0  # CIELAB beyond: half of that share


@dataclass(frozen=True, eq=False)
class PureFoliage:
    """What foliage looks like with nothing behind it. Pixels outside the foliage are the photo's."""

    rgb: NDArray[np.uint8]  # (H, W, 3) sRGB
    share: NDArray[np.float32]  # (H, W) in [0, 1] how much of a foliage pixel is leaf; 1 outside


@dataclass(frozen=True, eq=False)
class Backdrop:
    """What lies behind each pixel of a window."""

    rgb: NDArray[np.float32]  # (h, w, 3) in [0, 1]
    smoothness: NDArray[np.float32]  # (h, w) 1 for open sky, 0 for anything with texture


def pure_foliage(view: View) -> PureFoliage:
    """Take the background out of the view's foliage pixels."""
    rgb, share = view.photo.rgb.copy(), np.ones(view.mattes.foliage.shape, np.float32)
    is_open = cv2.erode((view.mattes.foliage + view.mattes.branch < OPEN).astype(np.uint8), np.ones((5, 5), np.uint8))
    rows, columns = np.nonzero(view.mattes.is_foliage)
    if not len(rows):
        return PureFoliage(rgb, share)
    margin = int(0.15 * max(np.ptp(rows), np.ptp(columns))) + 8
    part = (
        slice(max(0, rows.min() - margin), rows.max() + margin + 1),
        slice(max(0, columns.min() - margin), columns.max() + margin + 1),
    )
    colour = rgb[part].astype(np.float32) / np.float32(255)
    inside = view.mattes.is_foliage[part]
    if not is_open[part].any():
        return PureFoliage(rgb, share)
    behind = spread_backdrop(colour, is_open[part] > 0)
    share[part][inside] = leaf_share(colour[inside], behind.rgb[inside], behind.smoothness[inside])
    pure = unmix(colour, behind.rgb, share[part], inside)
    pure = untinted(aired(pure, colour, inside), behind, inside, pure)
    rgb[part][inside] = np.round(255 * pure[inside]).astype(np.uint8)
    return PureFoliage(rgb, share)


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


def unmix(
    colour: NDArray[np.float32], behind: NDArray[np.float32], share: NDArray[np.float32], inside: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """The leaves' own colour (h, w, 3) in [0, 1]; pixels with little leaf take it from those around them."""
    pure = np.clip(behind + (colour - behind) / np.maximum(share, LEAST)[..., None], 0, 1)
    weight = np.where(inside, share, 0) ** 4
    layers = np.dstack([pure * weight[..., None], weight])
    h, w = share.shape
    small = cv2.resize(layers, (max(1, w // COARSER), max(1, h // COARSER)), interpolation=cv2.INTER_AREA)
    near = 0.15 * cv2.GaussianBlur(small, (0, 0), SPREAD) + 0.01 * cv2.GaussianBlur(small, (0, 0), 4 * SPREAD)
    near += 1e-6 * small.mean(axis=(0, 1)) / max(float(small[..., 3].mean()), 1e-9)
    total = layers + cv2.resize(near, (w, h), interpolation=cv2.INTER_LINEAR)
    mixed = total[..., :3] / total[..., 3:]
    return np.asarray(np.where((share < 1)[..., None], mixed, colour), np.float32)


def aired(pure: NDArray[np.float32], mixed: NDArray[np.float32], inside: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Foliage colours (h, w, 3) lighter where the photo's foliage lets light through: as a crown looks from afar.

    Leaves drawn over every pixel of the matte leave no gap for the sky that the photo shows there,
    so they keep a part of its light, spread over their surroundings.
    """
    weight = inside.astype(np.float32)[..., None]
    lab = [cv2.cvtColor(rgb, cv2.COLOR_RGB2LAB) for rgb in (pure, mixed)]
    h, w = inside.shape
    layers = np.dstack([(lab[1] - lab[0]) * weight, weight])
    small = cv2.resize(layers, (max(1, w // COARSER), max(1, h // COARSER)), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), SPREAD) + np.float32(1e-6)
    missing = cv2.resize(small[..., :3] / small[..., 3:], (w, h), interpolation=cv2.INTER_LINEAR)
    return np.asarray(lab[0] + AIR * missing, np.float32)


def untinted(
    lab: NDArray[np.float32], behind: Backdrop, inside: NDArray[np.bool_], pure: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Foliage colours (h, w, 3) CIELAB rid of the tint of the sky behind the crown: RGB in [0, 1].

    Cameras keep colour more coarsely than light: a dark twig before a blue sky is blue. What is more
    like the sky in hue than the plainer part of the `pure` colours takes that part's hue, and keeps its light.
    """
    sky = sky_hue(behind, inside)
    if sky is not None:
        own = cv2.cvtColor(pure[inside][None], cv2.COLOR_RGB2LAB)[0]
        tint = own[:, 1:] @ sky
        plain = tint <= np.percentile(tint, PLAIN)
        light, hue = float(np.median(own[plain, 0])), np.median(own[plain, 1:], axis=0)
        shade = np.clip(lab[..., :1] / max(light, 1.0), 0, 1.5)
        most = max(0.0, float(np.percentile(tint[plain], PLAIN_MOST)))
        over = np.maximum(lab[..., 1:] @ sky - most * shade[..., 0], 0)
        turned = (over / (over + HALF_TURNED))[..., None]
        across = lab[..., 1:] - (lab[..., 1:] @ sky)[..., None] * sky
        own_across = (np.array(hue) - (hue @ sky) * sky).astype(np.float32)
        lean = LEAN * shade * (hue @ sky) * sky + ACROSS * (shade * own_across - across)
        shift = turned * lean - TAKEN * over[..., None] * sky
        lab = np.dstack([lab[..., 0], lab[..., 1:] + kept_near(shift, lab, inside) * shift])
    return np.clip(cv2.cvtColor(lab, cv2.COLOR_LAB2RGB), 0, 1)


def kept_near(shift: NDArray[np.float32], lab: NDArray[np.float32], inside: NDArray[np.bool_]) -> float:
    """The share in [0, 1] of a shift (h, w, 2) of a* b* that leaves the crown as a whole within BOUND of the photo."""
    chroma = np.linalg.norm(lab[inside][:, 1:], axis=1)
    far = np.linalg.norm(shift[inside], axis=1) / (1 + 0.045 * chroma)  # as CIE94 and CIEDE2000 count chroma
    return min(1.0, BOUND / max(float(far.mean()), 1e-6))


def sky_hue(behind: Backdrop, inside: NDArray[np.bool_]) -> NDArray[np.float32] | None:
    """The unit direction (2,) in CIELAB's a* b* of the sky behind a crown; None for a grey sky, or hardly any."""
    is_sky = inside & (behind.smoothness > 0.5)
    if np.count_nonzero(is_sky) < SKY * np.count_nonzero(inside):
        return None
    hue = cv2.cvtColor(behind.rgb[is_sky].mean(axis=0)[None, None], cv2.COLOR_RGB2LAB)[0, 0, 1:]
    chroma = float(np.linalg.norm(hue))
    return hue / chroma if chroma >= HUE else None
