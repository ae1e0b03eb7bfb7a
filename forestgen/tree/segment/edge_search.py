"""A limb laid straight: which samples across it are wood, from colours of the same stretch and from edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

WINDOW = 12.0  # sigma of the stretch, in stations, over which colours are compared
CLIP = 3.0  # nats: what one sample can say at most, so that a knot or a sunlit spot does not cut the limb
GUARD = 0.8  # share of the limb's width on either side that counts as neither: its shaded side, soft edges
NOISE = 6 / 255  # least spread in sRGB of a Gaussian: bark and walls vary more than sky does
SHADE, SHADED = 0.2, 0.1  # spread in sRGB of the unlit side and of sunlit spots, and the share of such samples
FEW = 0.02  # samples of the whole strip's mean that count in each stretch, so that none is empty
EDGE = 3.0  # nats that the strongest edges add to a boundary
STRAY = 8  # samples by which the stroke may run beside its limb
TURN = 1.5  # nats that it costs to move an edge by one sample from one station to the next
EXCESS = 3.5  # nats that each sample beyond the plausible width costs: more than a sample can say for itself
NEVER = -1e9


def find_edges(
    strip: NDArray[np.float32],
    is_wood: NDArray[np.bool_],
    *,
    guard: int = 2,
    widest: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Indices of the first and last sample of wood at each station, and how clearly it stands out (S,)."""
    says = wood_evidence(strip, is_wood, guard)
    jump = np.linalg.norm(np.diff(gaussian_filter1d(strip, 1.0, axis=0), axis=1), axis=2)
    jump = jump / (np.median(jump) + np.quantile(jump, 0.9) + 1e-6)
    edge = np.zeros((len(strip), strip.shape[1] + 1))
    edge[:, 1:-1] = EDGE * np.minimum(jump, 1)
    low, high = best_edges(says, edge, widest)
    inside = np.concatenate([np.zeros((len(says), 1)), np.cumsum(says, axis=1)], axis=1)
    rows = np.arange(len(says))
    clarity = (inside[rows, high + 1] - inside[rows, low]) / (high + 1 - low)
    return low, high, gaussian_filter1d(clarity, WINDOW / 2, mode="nearest")


def wood_evidence(strip: NDArray[np.float32], is_wood: NDArray[np.bool_], guard: int) -> NDArray[np.float64]:
    """Log likelihood ratio (S, O), wood against what is beside it, from colours of the same stretch.

    One Gaussian for the wood and one for each side, all fitted within WINDOW stations. At least
    `guard` samples beside the marked wood count as neither.
    """
    across = np.arange(strip.shape[1])[None]
    first = is_wood.argmax(axis=1)[:, None]
    last = strip.shape[1] - 1 - is_wood[:, ::-1].argmax(axis=1)[:, None]
    apart = np.maximum(guard, GUARD * (last - first + 1))
    wood = _local_log_density(strip, is_wood)
    shade = _local_log_density(strip, is_wood, SHADE)
    wood = np.logaddexp(wood + np.log(1 - SHADED), shade + np.log(SHADED))
    left, right = across < np.maximum(first - apart, 3), across > np.minimum(last + apart, strip.shape[1] - 4)
    beside = np.logaddexp(_local_log_density(strip, left), _local_log_density(strip, right)) - np.log(2)
    return np.asarray(np.clip(wood - beside, -CLIP, CLIP))


def _local_log_density(
    strip: NDArray[np.float32], which: NDArray[np.bool_], noise: float = NOISE
) -> NDArray[np.float64]:
    """Log density (S, O) under one Gaussian a station, fitted to the marked samples of the stretch about it."""
    w = which.astype(np.float64)
    x = strip.astype(np.float64)
    feature = np.concatenate([x, x[..., [0, 1, 2, 0, 0, 1]] * x[..., [0, 1, 2, 1, 2, 2]]], axis=2)
    every = np.einsum("so,soc->sc", w, feature)
    n = w.sum(axis=1)
    mass = gaussian_filter1d(n, WINDOW, mode="nearest") + FEW
    overall = every.sum(axis=0) / max(n.sum(), 1)
    moment = (gaussian_filter1d(every, WINDOW, axis=0, mode="nearest") + FEW * overall) / mass[:, None]
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
    impossible = np.where(lows[:, None] > highs[None], NEVER, 0.0)
    across_run = (highs[None] - lows[:, None] + 1).astype(float)

    def gain(s: int) -> NDArray[np.float64]:
        too_wide = 0.0 if widest is None else EXCESS * np.maximum(across_run - widest[s], 0)
        return np.asarray(starts[s][:, None] + ends[s][None] + impossible - too_wide)

    total = gain(0)
    came = np.empty((n, len(lows), len(highs)), np.int8)
    moves = [(i, j) for i in (0, -1, 1) for j in (0, -1, 1)]
    for s in range(1, n):
        padded = np.pad(total, 1, constant_values=NEVER)
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
