"""The foliage's own colour: the sky that shows through between needles and petals taken out of a photo's pixels.

Which share of a pixel is leaf says `backdrop.py`; here the leaves get the colours that they have
without the sky, its light and its tint.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.backdrop import Backdrop, leaf_share, spread_backdrop
from forestgen.tree.painted import painted_over
from forestgen.tree.painted_colour import dress_painted
from forestgen.tree.view import View

OPEN = 0.05  # matte below which a pixel is background
LEAST = 0.35  # share of leaf below which a pixel does not say its leaf's colour by itself
SPREAD = 3.0  # px of a picture COARSER times smaller: sigma from where such pixels take it
COARSER = 4
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


_KNOWN: WeakKeyDictionary[View, PureFoliage] = WeakKeyDictionary()
"""What was found already: atlas and leaves of a build ask for the same views, a third of a second each."""


def pure_foliage(view: View) -> PureFoliage:
    """The view's foliage without its background; what was painted there takes a leaf's colour too. Read-only."""
    if view not in _KNOWN:
        painted = painted_over(view.strokes.density, view.mattes.foliage.shape) & view.mattes.is_foliage
        seen = view.mattes.is_foliage & ~painted
        pure = without_background(view, seen)
        if painted.any():
            dress_painted(pure.rgb, pure.share, painted, seen)
        pure.rgb.setflags(write=False)
        pure.share.setflags(write=False)
        _KNOWN[view] = pure
    return _KNOWN[view]


def without_background(view: View, is_foliage: NDArray[np.bool_]) -> PureFoliage:
    """Take the background out of a view's foliage pixels (H, W)."""
    rgb, share = view.photo.rgb.copy(), np.ones(view.mattes.foliage.shape, np.float32)
    is_open = cv2.erode((view.mattes.foliage + view.mattes.branch < OPEN).astype(np.uint8), np.ones((5, 5), np.uint8))
    rows, columns = np.nonzero(is_foliage)
    if not len(rows):
        return PureFoliage(rgb, share)
    margin = int(0.15 * max(np.ptp(rows), np.ptp(columns))) + 8
    part = (
        slice(max(0, rows.min() - margin), rows.max() + margin + 1),
        slice(max(0, columns.min() - margin), columns.max() + margin + 1),
    )
    colour = rgb[part].astype(np.float32) / np.float32(255)
    inside = is_foliage[part]
    if not is_open[part].any():
        return PureFoliage(rgb, share)
    behind = spread_backdrop(colour, is_open[part] > 0)
    share[part][inside] = leaf_share(colour[inside], behind.rgb[inside], behind.smoothness[inside])
    pure = unmix(colour, behind.rgb, share[part], inside)
    pure = untinted(aired(pure, colour, inside), behind, inside, pure)
    rgb[part][inside] = np.round(255 * pure[inside]).astype(np.uint8)
    return PureFoliage(rgb, share)


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
