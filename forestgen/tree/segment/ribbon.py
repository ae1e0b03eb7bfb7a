"""Ribbon: the left and right edge of a limb along the stroke that was drawn over it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, median_filter

from forestgen.tree.segment.edge_search import find_edges

ACROSS = 28  # samples on either side of the stroke: the resolution of the edges in the first look
CORE = 2  # samples about the stroke that are taken for wood in the first look
APART = ACROSS // 2 - CORE  # samples beside it that are not yet taken for background in the first look
CLOSEST = 0.5  # px between stations at least
EVEN = 3.0  # stations over which the found edges are smoothed
STRETCH = 0.3  # share of the stroke over which a limb's usual width is taken
SLACK = 1.15  # by this factor a limb may be wider than it usually is below
CLEAR = 1.0  # nats a sample by which a limb stands out from what is beside it, where its edges can be seen
LOWER, FLARE = 0.4, 1.8  # at the root a limb is at most so much wider than usual in the lower share of its stroke
USUAL = 0.25  # quantile of a bare stretch's widths that stands for it: what is beside a limb only ever widens it
FEW = 5  # stations of a bare stretch that suffice to say how wide the limb is there
TAPER = 0.35  # width at the stroke's end, as a share of the width where the limb dives into the leaves
FINE = 4  # subpixels a side for the ribbon's cover
LONGEST = 30_000  # subpixels that OpenCV can fill along a side


@dataclass(frozen=True, eq=False)
class Ribbon:
    """A limb's outline along a stroke. S stations from the stroke's first point to its last, px."""

    left: NDArray[np.float64]  # (S, 2) xy
    right: NDArray[np.float64]  # (S, 2) xy
    clarity: NDArray[np.float64]  # (S,) nats by which the colours inside differ from those beside it

    @property
    def width(self) -> NDArray[np.float64]:
        """Width at each station (S,), px."""
        return np.asarray(np.linalg.norm(self.right - self.left, axis=1))

    def coverage(self, size: tuple[int, int], part: NDArray[np.bool_] | None = None) -> NDArray[np.float32]:
        """Share of each pixel (H, W) that the ribbon covers, or only its stations of a mask (S,)."""
        out = np.zeros(size[::-1], np.float32)
        edges = np.concatenate([self.left, self.right])
        low = np.maximum(np.floor(edges.min(axis=0)).astype(int) - 1, 0)
        high = np.minimum(np.ceil(edges.max(axis=0)).astype(int) + 1, size)
        if (high <= low).any():
            return out
        fineness = max(1, min(FINE, LONGEST // int((high - low).max())))
        fine = np.zeros((high - low)[::-1] * fineness, np.uint8)
        quads = np.stack([self.left[:-1], self.left[1:], self.right[1:], self.right[:-1]], axis=1)
        if part is not None:
            quads = quads[part[:-1]]
        for quad in np.round((quads - low) * fineness - 0.5).astype(np.int32):
            cv2.fillPoly(fine, [quad], 255)
        shape = (int(high[0] - low[0]), int(high[1] - low[1]))
        covered = cv2.resize(fine, shape, interpolation=cv2.INTER_AREA)
        out[low[1] : high[1], low[0] : high[0]] = covered / np.float32(255)
        return out


def follow_limb(rgb: NDArray[np.float32], path: NDArray[np.float64], reach: float, bare: float = 0.0) -> Ribbon:
    """Find a limb's edges along a stroke (K, 2) px, no farther than `reach` px from it.

    Looks twice: the second look uses the colours between the edges of the first and a finer grid.
    The first share `bare` of the stroke runs below the crown, where no leaves hide the edges.
    """
    corner = np.maximum(np.floor(path.min(axis=0) - 2 * reach).astype(int), 0)
    end = np.maximum(np.ceil(path.max(axis=0) + 2 * reach).astype(int), corner + 1)
    rgb, path = rgb[corner[1] : end[1], corner[0] : end[0]], path - corner
    pitch = reach / ACROSS
    place, _, offset, strip = _lay_straight(rgb, path, pitch, reach)
    low, high, clarity = find_edges(
        strip, np.broadcast_to(abs(offset) <= (CORE + 0.5) * pitch, strip.shape[:2]), guard=APART
    )
    widest = plausible_width(np.asarray(offset[high] - offset[low] + pitch), clarity, bare)
    half = float(np.quantile(np.maximum(abs(offset[low]), abs(offset[high])), 0.9)) + 2 * pitch
    first = np.stack([offset[low], offset[high], widest])

    pitch = min(reach, max(2.2 * half, 6.0)) / ACROSS
    before = len(place)
    place, normal, offset, strip = _lay_straight(rgb, path, pitch, reach)
    along = np.linspace(0, before - 1, len(place))
    lo, hi, at_most = (np.interp(along, np.arange(before), row)[:, None] for row in first)
    is_wood = (offset >= lo - pitch) & (offset <= hi + pitch)
    low, high, clarity = find_edges(strip, is_wood, widest=at_most[:, 0] / pitch)
    lo, hi = (gaussian_filter1d(offset[edge], EVEN, mode="nearest")[:, None] for edge in (low, high))
    left, right = place + (lo - pitch / 2) * normal, place + (hi + pitch / 2) * normal
    return Ribbon(left + corner, right + corner, clarity)


def _lay_straight(
    rgb: NDArray[np.float32], path: NDArray[np.float64], pitch: float, reach: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float32]]:
    """Stations (S, 2), their normals (S, 2), offsets (O,) px and the strip of colours (S, O, 3) between them."""
    place, normal = stations(path, max(pitch, CLOSEST), smooth=reach / 3)
    offset = np.arange(-ACROSS, ACROSS + 1, dtype=np.float64) * pitch
    return place, normal, offset, sample_strip(rgb, place, normal, offset)


def stations(
    path: NDArray[np.float64], pitch: float, *, smooth: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (S, 2) every `pitch` px along a polyline, and unit normals (S, 2), smoothed over `smooth` px."""
    path = path[np.concatenate([[True], np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-9])]
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    n = max(3, int(along[-1] / pitch) + 1)
    at = np.linspace(0, along[-1], n)
    place = np.stack([np.interp(at, along, path[:, axis]) for axis in (0, 1)], axis=1)
    sigma = max(smooth / pitch, 1e-3)
    tangent = np.gradient(place, axis=0)
    tangent = gaussian_filter1d(tangent, sigma, axis=0, mode="nearest")
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    return place, np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)


def sample_strip(
    rgb: NDArray[np.float32], place: NDArray[np.float64], normal: NDArray[np.float64], offset: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Colours (S, O, 3) at offsets (O,) px along the normals of the stations: the limb laid straight."""
    at = (place[:, None] + offset[None, :, None] * normal[:, None] - 0.5).astype(np.float32)
    pitch = float(offset[1] - offset[0])
    if pitch > 1.5:
        rgb = np.asarray(cv2.GaussianBlur(rgb, (0, 0), pitch / 3), np.float32)
    return np.asarray(cv2.remap(rgb, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def plausible_width(width: NDArray[np.float64], clarity: NDArray[np.float64], bare: float = 0.0) -> NDArray[np.float64]:
    """The greatest width (S,) that a limb may have: a little more than it has lower down, bulges left out.

    From where it dives into the leaves and its edges cannot be seen, it tapers towards the stroke's end.
    Beyond its `bare` share it is at most a little wider than the upper half of that share: dark limbs
    and dark leaves are one.
    """
    usual = median_filter(width, max(3, round(len(width) * STRETCH)), mode="nearest")
    lower = float(np.median(usual[: max(1, round(len(width) * LOWER))]))
    limit = np.minimum(SLACK * np.minimum.accumulate(usual), FLARE * lower) + 1
    dives = int(np.argmax(np.cumsum(clarity - CLEAR)))
    limit[dives:] *= np.linspace(1, TAPER, len(width) - dives)
    end = round(bare * len(width))
    if end >= FEW:
        limit[end:] = np.minimum(limit[end:], SLACK * np.quantile(width[end // 2 : end], USUAL) + 1)
    return np.asarray(limit)
