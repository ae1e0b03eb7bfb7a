"""Trunk strip: the bark that a photo shows, unrolled from the trunk and evenly lit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.view import View

WIDEST = 0.35  # half width that is looked for, as a share of the trunk stroke's length
SLIMMEST = 0.55  # the trunk ends, as a source of bark, where it is narrower than that share of its foot
BARK = 0.75  # share of a pixel that must be wood
WIDER = 1.7  # what is that much wider than the traced trunk is more than the trunk
ALIKE = (22.0, 7.0)  # lightness and chroma, CIELAB, by which bark may differ from the stroke's usual colours
LEAF = 0.25  # share of a pixel that may be leaf


@dataclass(frozen=True, eq=False)
class TrunkStrip:
    """The visible front of a trunk, unrolled, upright: H rows along it, W columns around it."""

    rgb: NDArray[np.float32]  # (H, W, 3) sRGB in [0, 1]
    is_bark: NDArray[np.bool_]  # (H, W) whether the pixel truly shows bark
    radius: float  # of the trunk, in pixels of the strip
    px_per_metre: float

    def __post_init__(self) -> None:
        freeze(self, rgb=(np.float32, "H", "W", 3), is_bark=(np.bool_, "H", "W"))


def trunk_strip(view: View, half_angle: float, n_across: int) -> TrunkStrip:
    """Unroll what a photo shows of the trunk under the trunk stroke.

    Around the trunk it reaches to `half_angle` radians either side of the front; a strip that
    would cover more than `n_across` pixels half way round the trunk is reduced to that. Without a
    trunk in the matte the strip has no rows.
    """
    centre, normal, half_width = trunk_outline(view)
    if not len(centre):
        return TrunkStrip(np.zeros((0, 1, 3), np.float32), np.zeros((0, 1), bool), 1.0, view.camera.px_per_metre)
    radius_px = float(np.median(half_width))
    shrink = min(1.0, n_across / (np.pi * radius_px))
    columns = max(1, round(2 * half_angle * radius_px * shrink))
    rows = max(1, round(len(centre) * shrink))
    row = np.linspace(len(centre) - 1, 0, rows).round().astype(np.int64)  # the stroke runs upward, rows down
    turn = ((np.arange(columns) + 0.5) / columns * 2 - 1) * half_angle
    xy = centre[row, None] + normal[row, None] * (half_width[row, None] * np.sin(turn))[:, :, None]
    where = (xy - 0.5).astype(np.float32)  # pixel centres lie at halves

    def sample(image: NDArray[Any]) -> NDArray[np.float32]:
        soft = np.asarray(image, np.float32)
        if shrink < 1:
            soft = np.asarray(cv2.GaussianBlur(soft, (0, 0), 0.4 / shrink), np.float32)
        return np.asarray(cv2.remap(soft, where[..., 0], where[..., 1], cv2.INTER_CUBIC), np.float32)

    is_bark = (sample(view.mattes.branch) > BARK) & (sample(view.mattes.foliage) < LEAF)
    is_bark &= looks_like(sample(view.photo.rgb), under_stroke(view))
    rgb = np.asarray(np.clip(sample(view.photo.rgb) / 255, 0, 1), np.float32)
    return TrunkStrip(rgb, is_bark, radius_px * shrink, view.camera.px_per_metre * shrink)


def trunk_outline(
    view: View,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Centre (S, 2) px, unit normal to the right (S, 2) and half width (S,) px of the trunk, one row a pixel.

    Found in the branch matte across the trunk stroke, from the root upward; rows where the matte
    shows no trunk, or another width than around, are closed from their neighbours.
    """
    path = walk(view.strokes.branches[0])
    if len(path) < 8:
        return np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)
    tangent = np.gradient(cv2.GaussianBlur(path, (1, 0), sigmaX=1, sigmaY=len(path) / 20), axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)  # y down: to the right when going up
    reach = np.arange(-(widest := max(3, round(WIDEST * len(path) / 2))), widest + 1)
    across = path[:, None] + normal[:, None] * reach[None, :, None] - 0.5
    wood = cv2.remap(
        view.mattes.branch, across[..., 0].astype(np.float32), across[..., 1].astype(np.float32), cv2.INTER_LINEAR
    )
    left, right = extents(wood >= 0.5, reach)
    half, shift = (right - left) / 2, (right + left) / 2
    seen = (half >= 1) & (half <= WIDER * traced_radius(view))
    if seen.sum() < 8:
        return np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)
    foot = np.median(half[seen][: max(8, int(seen.sum()) // 3)])
    usable = seen & (half >= SLIMMEST * foot) & (half <= 1.6 * foot)
    usable[-1 if not usable.any() else len(usable) - int(np.argmax(usable[::-1])) :] = False
    if usable.sum() < 8:
        return np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)
    end = int(np.flatnonzero(usable)[-1]) + 1
    row = np.arange(end)
    half, shift = (smooth(np.interp(row, row[usable[:end]], v[:end][usable[:end]])) for v in (half, shift))
    return path[:end] + normal[:end] * shift[:, None], normal[:end], half


def traced_radius(view: View) -> float:
    """Radius px that the tracing found for the lower trunk, infinite where it measured none."""
    length = np.linalg.norm(np.diff(view.strokes.branches[0], axis=0), axis=1).sum()
    low = np.linalg.norm(view.branches.xy - view.strokes.root, axis=1) < length / 3
    measured = view.branches.radius_px[low & np.isfinite(view.branches.radius_px)]
    return float(measured.max()) if len(measured) else np.inf


def under_stroke(view: View) -> NDArray[np.uint8]:
    """Colours (S, 3) sRGB under the lower part of the trunk stroke: bark, the user says."""
    path = walk(view.strokes.branches[0])
    column, row = np.floor(path[: max(8, len(path) * 2 // 5)]).astype(np.int64).T
    width, height = view.photo.size
    return np.asarray(view.photo.rgb[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)])


def looks_like(rgb: NDArray[np.float32], known: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Whether pixels (H, W, 3), sRGB 0 to 255, have a colour near the `known` ones (S, 3), in whatever light.

    A matte that took sky, a wall or leaves for wood is not to be pasted all over the tree.
    """

    def lab(values: NDArray[Any]) -> NDArray[np.float32]:
        soft = np.asarray(np.clip(values, 0, 255) / 255, np.float32)
        return np.asarray(cv2.cvtColor(soft, cv2.COLOR_RGB2LAB), np.float32)

    reference, here = lab(known[None])[0], lab(cv2.GaussianBlur(rgb, (0, 0), 1.0))
    middle = np.median(reference, axis=0)
    spread = np.median(np.abs(reference - middle), axis=0)
    off = np.abs(here - middle)
    hue = np.hypot(off[..., 1], off[..., 2]) <= ALIKE[1] + 3 * np.hypot(spread[1], spread[2])
    return np.asarray(hue & (off[..., 0] <= ALIKE[0] + 3 * spread[0]))


def walk(path: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (S, 2) about one pixel apart along a polyline (K, 2)."""
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    s = np.arange(0, along[-1] + 1e-9)
    return np.stack([np.interp(s, along, path[:, k]) for k in range(2)], axis=1)


def extents(is_wood: NDArray[np.bool_], reach: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Left and right end (S,) of the run of wood nearest to the stroke in each row (S, A), px from it.

    Both 0 where there is none within a quarter of the reach.
    """
    nearest = np.argmin(np.where(is_wood, np.abs(reach), 10 * len(reach)), axis=1)
    hit = is_wood[np.arange(len(is_wood)), nearest] & (np.abs(reach[nearest]) <= len(reach) / 8)
    column = np.arange(len(reach))
    before = np.where(~is_wood & (column <= nearest[:, None]), column, -1).max(axis=1)
    after = np.where(~is_wood & (column >= nearest[:, None]), column, len(reach)).min(axis=1)
    left, right = reach[0] + before + 0.5, reach[0] + after - 0.5
    return np.where(hit, left, 0.0), np.where(hit, right, 0.0)


def smooth(value: NDArray[np.float64]) -> NDArray[np.float64]:
    """A row-wise measure (S,) without outliers and jitter."""
    from scipy.ndimage import gaussian_filter1d, median_filter

    size = max(3, len(value) // 12)
    return np.asarray(gaussian_filter1d(median_filter(value, size, mode="nearest"), size / 3, mode="nearest"))


def bark_colour(strip: TrunkStrip) -> NDArray[np.float32]:
    """Mean sRGB (3,) of the strip's bark, in light and in shade: what the trunk is from afar."""
    return np.asarray(strip.rgb[strip.is_bark].mean(axis=0), np.float32)


def evenly_lit(strip: TrunkStrip, evenness: float) -> TrunkStrip:
    """Take light and shade out: divide by the local mean colour, and give all the mean colour of the whole.

    What is larger than `evenness` times the strip's width counts as light.
    """
    valid = strip.is_bark.astype(np.float32)
    sigma = max(1.0, evenness * strip.rgb.shape[1])
    weight = cv2.GaussianBlur(valid, (0, 0), sigma)
    colour = bark_colour(strip)
    local = cv2.GaussianBlur(strip.rgb * valid[..., None], (0, 0), sigma) / np.maximum(weight, 1e-4)[..., None]
    profile = np.sum(strip.rgb * valid[..., None], axis=0) / np.maximum(valid.sum(axis=0), 1)[:, None]
    profile = cv2.GaussianBlur(profile[None], (0, 0), max(1.0, 0.06 * len(profile)), sigmaY=1e-3)
    blurred = cv2.GaussianBlur(profile, (0, 0), sigma, sigmaY=1e-3)
    light = local * profile / np.maximum(blurred, 1e-3)
    even = strip.rgb * np.clip(colour / np.maximum(light, 1 / 255), 0.3, 3.0)
    even[~strip.is_bark] = colour
    depth = cv2.GaussianBlur(np.sum((even - colour) ** 2, axis=2), (0, 0), 2 * sigma) / np.maximum(
        cv2.GaussianBlur(valid, (0, 0), 2 * sigma), 1e-3
    )
    evens = np.clip(np.median(depth[strip.is_bark]) / np.maximum(depth, 1e-9), 0.3, 3.0) ** 0.3
    even = colour + (even - colour) * evens[..., None]  # shade is duller, and dull patches would stand out
    return TrunkStrip(np.clip(even, 0, 1), strip.is_bark, strip.radius, strip.px_per_metre)
