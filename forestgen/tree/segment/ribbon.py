"""Ribbon: the left and right edge of a limb along the stroke that was drawn over it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, median_filter

ACROSS = 28  # samples on either side of the stroke: the resolution of the edges in the first look
CORE = 2  # samples about the stroke that are taken for wood in the first look
STRAY = 8  # samples by which the stroke may run beside its limb
WINDOW = 12.0  # sigma of the stretch, in stations, over which colours are compared
CLIP = 3.0  # nats: what one sample can say at most, so that a knot or a sunlit spot does not cut the limb
GUARD = 0.8  # share of the limb's width on either side that counts as neither: its shaded side, soft edges
SHADE, SHADED = 0.2, 0.1  # spread in sRGB of the unlit side and of sunlit spots, and the share of such samples
EDGE = 3.0  # what a strong edge adds to a boundary, in units of samples
STRETCH = 0.3  # share of the stroke over which a limb's usual width is taken
SLACK = 1.15  # by this factor a limb may be wider than it usually is below
EXCESS = 3.5  # nats that each sample beyond that costs: more than a sample can say for itself
CLEAR = 1.0  # nats a sample by which a limb stands out from what is beside it, where its edges can be seen
TAPER = 0.35  # width at the stroke's end, as a share of the width where the limb dives into the leaves
FINE = 4  # subpixels a side for the ribbon's cover
TURN = 1.5  # what moving an edge by one sample from one station to the next costs, in units of samples


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
        fine = np.zeros((high - low)[::-1] * FINE, np.uint8)
        quads = np.stack([self.left[:-1], self.left[1:], self.right[1:], self.right[:-1]], axis=1)
        if part is not None:
            quads = quads[part[:-1]]
        for quad in np.round((quads - low) * FINE - 0.5).astype(np.int32):
            cv2.fillPoly(fine, [quad], 255)
        shape = (int(high[0] - low[0]), int(high[1] - low[1]))
        covered = cv2.resize(fine, shape, interpolation=cv2.INTER_AREA)
        out[low[1] : high[1], low[0] : high[0]] = covered / np.float32(255)
        return out


def follow_limb(rgb: NDArray[np.float32], path: NDArray[np.float64], reach: float) -> Ribbon:
    """Find a limb's edges along a stroke (K, 2) px, no farther than `reach` px from it.

    Looks twice: the second look uses the colours between the edges of the first and a finer grid.
    """
    pitch = reach / ACROSS
    place, normal = stations(path, pitch, smooth=reach / 3)
    offset = np.arange(-ACROSS, ACROSS + 1) * pitch
    strip = sample_strip(rgb, place, normal, offset)
    is_wood = np.broadcast_to(abs(np.arange(-ACROSS, ACROSS + 1)) <= CORE, strip.shape[:2])
    low, high, clarity = _edges(strip, is_wood)
    widest = plausible_width((high - low + 1) * pitch, clarity)
    half = float(np.quantile(np.maximum(abs(offset[low]), abs(offset[high])), 0.9)) + 2 * pitch
    finer = min(reach, max(2.2 * half, 6.0)) / ACROSS
    fine_place, fine_normal = stations(path, max(finer, 0.5), smooth=reach / 3)
    along = np.linspace(0, len(place) - 1, len(fine_place))
    lo = np.interp(along, np.arange(len(place)), offset[low])
    hi = np.interp(along, np.arange(len(place)), offset[high])
    offset = np.arange(-ACROSS, ACROSS + 1) * finer
    strip = sample_strip(rgb, fine_place, fine_normal, offset)
    is_wood = (offset >= lo[:, None]) & (offset <= hi[:, None])
    at_most = np.interp(along, np.arange(len(place)), widest) / finer
    low, high, clarity = _edges(strip, is_wood, at_most)
    lo, hi = (gaussian_filter1d(offset[edge], 3.0, mode="nearest") for edge in (low, high))
    left = fine_place + (lo - finer / 2)[:, None] * fine_normal
    right = fine_place + (hi + finer / 2)[:, None] * fine_normal
    return Ribbon(left, right, clarity)


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
        rgb = cv2.GaussianBlur(rgb, (0, 0), pitch / 3)
    return np.asarray(cv2.remap(rgb, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def plausible_width(width: NDArray[np.float64], clarity: NDArray[np.float64]) -> NDArray[np.float64]:
    """The greatest width (S,) that a limb may have: a little more than it has lower down, bulges left out.

    From where it dives into the leaves and its edges cannot be seen, it tapers towards the stroke's end.
    """
    usual = median_filter(width, max(3, round(len(width) * STRETCH)), mode="nearest")
    limit = SLACK * np.minimum.accumulate(usual) + 1
    dives = int(np.argmax(np.cumsum(clarity - CLEAR)))
    limit[dives:] *= np.linspace(1, TAPER, len(width) - dives)
    return np.asarray(limit)


def _edges(
    strip: NDArray[np.float32], is_wood: NDArray[np.bool_], widest: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Indices of the first and last sample of wood at each station, and how clearly it stands out (S,)."""
    says = wood_evidence(strip, is_wood)
    jump = np.linalg.norm(np.diff(gaussian_filter1d(strip, 1.0, axis=0), axis=1), axis=2)
    jump = jump / (np.median(jump) + np.quantile(jump, 0.9) + 1e-6)
    edge = np.zeros((len(strip), strip.shape[1] + 1))
    edge[:, 1:-1] = EDGE * np.minimum(jump, 1)
    low, high = best_edges(says, edge, widest)
    inside = np.concatenate([np.zeros((len(says), 1)), np.cumsum(says, axis=1)], axis=1)
    rows = np.arange(len(says))
    clarity = (inside[rows, high + 1] - inside[rows, low]) / (high + 1 - low)
    return low, high, gaussian_filter1d(clarity, WINDOW / 2, mode="nearest")


def wood_evidence(strip: NDArray[np.float32], is_wood: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Log likelihood ratio (S, O), wood against what is beside it, from colours of the same stretch.

    One Gaussian for the wood and one for each side, all fitted within WINDOW stations.
    """
    across = np.arange(strip.shape[1])[None]
    first = is_wood.argmax(axis=1)[:, None]
    last = strip.shape[1] - 1 - is_wood[:, ::-1].argmax(axis=1)[:, None]
    guard = np.maximum(2, GUARD * (last - first + 1))
    wood = _local_log_density(strip, is_wood)
    shade = _local_log_density(strip, is_wood, SHADE)
    wood = np.logaddexp(wood + np.log(1 - SHADED), shade + np.log(SHADED))
    left, right = across < np.maximum(first - guard, 3), across > np.minimum(last + guard, strip.shape[1] - 4)
    beside = np.logaddexp(_local_log_density(strip, left), _local_log_density(strip, right)) - np.log(2)
    return np.clip(wood - beside, -CLIP, CLIP)


def _local_log_density(
    strip: NDArray[np.float32], which: NDArray[np.bool_], noise: float = 6 / 255
) -> NDArray[np.float64]:
    """Log density (S, O) under one Gaussian a station, fitted to the marked samples of the stretch about it."""
    w = which.astype(np.float64)
    x = strip.astype(np.float64)
    feature = np.concatenate([x, x[..., [0, 1, 2, 0, 0, 1]] * x[..., [0, 1, 2, 1, 2, 2]]], axis=2)
    every = np.einsum("so,soc->sc", w, feature)
    n = w.sum(axis=1)
    prior = 0.02  # so many samples of the whole strip's mean in each stretch: never empty
    mass = gaussian_filter1d(n, WINDOW, mode="nearest") + prior
    overall = every.sum(axis=0) / max(n.sum(), 1)
    moment = (gaussian_filter1d(every, WINDOW, axis=0, mode="nearest") + prior * overall) / mass[:, None]
    mean = moment[:, :3]
    covariance = np.empty((len(strip), 3, 3))
    for column, (i, j) in zip(range(3, 9), ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)), strict=True):
        covariance[:, i, j] = covariance[:, j, i] = moment[:, column] - mean[:, i] * mean[:, j]
    covariance += noise**2 * np.eye(3)
    away = x - mean[:, None]
    distance = np.einsum("soi,sij,soj->so", away, np.linalg.inv(covariance), away)
    return np.asarray(-0.5 * distance - 0.5 * np.linalg.slogdet(covariance)[1][:, None])


def best_edges(
    says: NDArray[np.float64], edge: NDArray[np.float64], widest: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and last wood sample of each station (S,), by dynamic programming over both edges at once.

    The best run of samples at each station (evidence `says` (S, O) inside, `edge` (S, O + 1) on its
    two boundaries), where an edge moves by at most one sample a station and pays TURN for it. Where
    `widest` (S,) samples are given, each sample more costs EXCESS.
    """
    n, across = says.shape
    middle = across // 2
    lows = np.arange(0, middle + STRAY + 1)
    highs = np.arange(middle - STRAY, across)
    inside = np.concatenate([np.zeros((n, 1)), np.cumsum(says, axis=1)], axis=1)
    ends = inside[:, highs + 1] + edge[:, highs + 1]
    starts = edge[:, lows] - inside[:, lows]
    impossible = np.where(lows[:, None] > highs[None], -1e9, 0.0)
    across_run = (highs[None] - lows[:, None] + 1).astype(float)

    def gain(s: int) -> NDArray[np.float64]:
        too_wide = 0.0 if widest is None else EXCESS * np.maximum(across_run - widest[s], 0)
        return np.asarray(starts[s][:, None] + ends[s][None] + impossible - too_wide)

    total = gain(0)
    came = np.empty((n, len(lows), len(highs)), np.int8)
    moves = [(i, j) for i in (0, -1, 1) for j in (0, -1, 1)]
    for s in range(1, n):
        padded = np.pad(total, 1, constant_values=-1e9)
        options = np.stack(
            [padded[1 + i : 1 + i + len(lows), 1 + j : 1 + j + len(highs)] - TURN * (abs(i) + abs(j)) for i, j in moves]
        )
        came[s] = options.argmax(axis=0)
        total = options.max(axis=0) + gain(s)
    low, high = np.empty(n, np.int64), np.empty(n, np.int64)
    a, b = np.unravel_index(total.argmax(), total.shape)
    for s in range(n - 1, -1, -1):
        low[s], high[s] = lows[a], highs[b]
        if s:
            i, j = moves[came[s, a, b]]
            a, b = a + i, b + j
    return low, high
