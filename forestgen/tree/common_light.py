"""One light for all photos of a tree: the foliage of each is moved to the colours that they have in common.

A leaf has one colour, however many photos show it. Photos taken at other times of day, or with
another exposure and white balance, do not agree on it.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.foliage_unmixing import PureFoliage, pure_foliage
from forestgen.tree.leaf_colours import lab_of
from forestgen.tree.view import View

log = logging.getLogger(__name__)

KEPT = 0.3  # share of what sets a photo apart that its foliage keeps: too little to show where two meet
FAR_APART = 8.0  # CIEDE2000 between a photo's mean colour and the common one that no tree can be true to
STRETCH = 2.0  # most that a photo's spread of colours is stretched or narrowed
LEAST_SPREAD = 1.0  # CIELAB: a photo's colours spread at least so far, when they are compared


def in_common_light(views: Sequence[View]) -> list[PureFoliage]:
    """Each view's foliage without its background, moved towards the mean and the spread of colour of all of them.

    In CIELAB, channel by channel (Reinhard et al. 2001, "Color transfer between images"). Photos weigh by
    their chroma: a dim or hazy one says less about a leaf's colour. One view stays as it is.
    """
    pure = [pure_foliage(view) for view in views]
    if len(views) == 1:
        return pure
    looks = np.array([look(view, own) for view, own in zip(views, pure, strict=True)])
    common = np.average(looks, axis=0, weights=np.hypot(looks[:, 0, 1], looks[:, 0, 2]) + 1.0)
    warn_if_apart(looks[:, 0], common[0])
    return [
        PureFoliage(moved(own.rgb, view.mattes.is_foliage, now, KEPT * now + (1 - KEPT) * common), own.share)
        for view, own, now in zip(views, pure, looks, strict=True)
    ]


def warn_if_apart(means: NDArray[np.float64], common: NDArray[np.float64]) -> None:
    """Say so where the photos' mean colours (V, 3) CIELAB differ so much that a tree cannot be true to all."""
    from skimage.color import deltaE_ciede2000

    far = deltaE_ciede2000(means, np.broadcast_to(common, means.shape))  # type: ignore[no-untyped-call]
    if far.max() > FAR_APART:
        log.warning(
            "photo %d shows its foliage in another light: the mean colour is %.1f CIEDE2000 from the common one",
            far.argmax() + 1,
            far.max(),
        )


def look(view: View, pure: PureFoliage) -> NDArray[np.float64]:
    """Mean and standard deviation (2, 3) of a view's foliage in CIELAB, each pixel weighted by its share of leaf."""
    inside = view.mattes.is_foliage
    lab = lab_of(pure.rgb[inside]).astype(float)
    weight = (view.mattes.foliage * pure.share**2)[inside]
    mean = np.average(lab, axis=0, weights=weight)
    return np.stack([mean, np.sqrt(np.average((lab - mean) ** 2, axis=0, weights=weight))])


def moved(
    rgb: NDArray[np.uint8], inside: NDArray[np.bool_], now: NDArray[np.float64], wish: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """A picture (H, W, 3) whose pixels inside (H, W) go from one mean and spread (2, 3) CIELAB to another."""
    stretch = np.clip(np.maximum(wish[1], LEAST_SPREAD) / np.maximum(now[1], LEAST_SPREAD), 1 / STRETCH, STRETCH)
    lab = (lab_of(rgb[inside]) - now[0]) * stretch + wish[0]
    out = rgb.copy()
    other = cv2.cvtColor(lab[None].astype(np.float32), cv2.COLOR_LAB2RGB)[0]
    out[inside] = np.round(255 * np.clip(other, 0, 1)).astype(np.uint8)
    return out
