"""Colours of leaves through the year: what a leaf's own colour is, and how a photographed leaf takes on another."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.leaf_colours import lab_of
from forestgen.tree.srgb import LUMINANCE, bytes_from_linear, linear_from_bytes, linear_from_srgb

# A leaf in full light, CIELAB, along the way from chlorophyll to dry brown: ours, read off photographs of
# beech, birch, maple and oak. `at` is how far a leaf has turned.
TURNING = {
    "green": (0.00, 38.0, -17.0, 30.0),
    "yellow-green": (0.16, 57.0, -9.0, 47.0),
    "yellow": (0.34, 66.0, 5.0, 56.0),
    "gold": (0.52, 59.0, 17.0, 53.0),
    "orange": (0.70, 50.0, 27.0, 50.0),
    "russet": (0.86, 39.0, 24.0, 35.0),
    "brown": (1.00, 33.0, 12.0, 24.0),
}
STEPS = 256  # of the table along the way
BRIGHTENED, DARKENED = 0.65, 1.0  # how much of a new leaf's difference in reflectance shows (as an exponent): ours.
# A photographer closes the lens for a bright crown; a dark one keeps no lights that were a bright leaf's
HAZE = 0.35  # how much of a texel's lack of colour (sky mirrored on the leaf, mist) stays
UNEVEN_LIGHT = 0.35  # how much of what makes a texel turn more than its leaf shows in its lightness
KNEE = 0.72  # linear light from which a new colour is held back, so that none is clipped
PETAL = 0.5  # reflectance of white to pink blossom
GREY = 0.4  # CIELAB chroma over lightness below which a colour tells nothing about the season
GREENEST, YELLOWEST, REDDEST = 200.0, 95.0, 15.0  # degrees of CIELAB hue: green up to GREENEST, turned below YELLOWEST

IS_GREEN, IS_TURNED, IS_NEITHER = 0, 1, 2


def classify(lab: NDArray[np.floating]) -> NDArray[np.int64]:
    """Green, turned or neither (K,) for mean colours (K, 3) CIELAB of leaves. Blossom and mirrored sky are neither."""
    hue = np.degrees(np.arctan2(lab[:, 2], lab[:, 1])) % 360
    colourful = np.hypot(lab[:, 1], lab[:, 2]) / np.maximum(lab[:, 0], 1.0)
    is_green = (hue >= YELLOWEST) & (hue <= GREENEST) & (colourful >= GREY / 2)
    is_turned = (hue >= REDDEST) & (hue < YELLOWEST) & (colourful >= GREY)
    return np.where(is_green, IS_GREEN, np.where(is_turned, IS_TURNED, IS_NEITHER))


def leaf_light(turned: NDArray[np.floating]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Hue and saturation as linear RGB of luminance 1 (N, 3), and reflectance (N,), of leaves so far turned (N,)."""
    table = _table()
    index = np.round(np.clip(turned, 0, 1) * (STEPS - 1)).astype(np.int64)
    colour = table[index]
    light = colour @ LUMINANCE.astype(np.float32)
    return colour / light[:, None], light


def _table() -> NDArray[np.float32]:
    """Linear RGB (STEPS, 3) along the way."""
    at, *lab = np.array(list(TURNING.values())).T
    way = np.linspace(0, 1, STEPS)
    colour = np.column_stack([np.interp(way, at, channel) for channel in lab]).astype(np.float32)
    srgb = cv2.cvtColor(colour[None], cv2.COLOR_LAB2RGB)[0]
    return linear_from_srgb(np.clip(srgb, 0, 1)).astype(np.float32)


def reflectance(lab: NDArray[np.floating]) -> float:
    """How much light leaves throw back whose mean colour is `lab` (3,) CIELAB: by their hue, however they are lit.

    Green leaves all alike, turned ones as the palette's of that hue, red ones as orange ones: what is redder in
    the palette is also duller. What is neither is taken for petals.
    """
    kind = int(classify(np.asarray(lab)[None])[0])
    if kind == IS_NEITHER:
        return PETAL
    way = np.linspace(0, 0 if kind == IS_GREEN else TURNING["orange"][0], STEPS)
    tint, gives = leaf_light(way)
    of_way = lab_of(bytes_from_linear(tint * gives[:, None]))
    return float(gives[np.argmin(np.abs(np.arctan2(of_way[:, 2], of_way[:, 1]) - np.arctan2(lab[2], lab[1])))])


def repaint(
    rgb: NDArray[np.uint8], turned: NDArray[np.floating], uneven: NDArray[np.floating], was: float, colourful: float
) -> NDArray[np.uint8]:
    """Texels (N, 3) sRGB of leaves as if those had turned so far (N,): the light on them and its texture stay.

    `uneven` (N,) is how much farther or less a texel has turned than its leaf: it moves the hue fully, the
    lightness in part. `was` is the reflectance that the light was thrown back with, `colourful` the usual
    CIELAB chroma over lightness among the leaves: a texel with less is mirrored sky or mist, and keeps part of that.
    """
    light = linear_from_bytes(rgb) @ LUMINANCE.astype(np.float32)
    tint, _ = leaf_light(turned + uneven)
    _, gives = leaf_light(turned + UNEVEN_LIGHT * uneven)
    lab = lab_of(rgb)
    own = np.hypot(lab[:, 1], lab[:, 2]) / (lab[:, 0] + 1) / max(colourful, 1e-3)
    gain = (gives / was) ** np.where(gives > was, BRIGHTENED, DARKENED)
    vivid = 1 - HAZE * (1 - np.clip(own, 0, 1))
    out = (1 + (tint - 1) * vivid[:, None]) * (light * gain)[:, None]
    most = out.max(axis=1)
    held = np.where(most > KNEE, KNEE + (1 - KNEE) * (1 - np.exp(-(most - KNEE) / (1 - KNEE))), most)
    return bytes_from_linear(out * (held / np.maximum(most, 1e-6))[:, None])
