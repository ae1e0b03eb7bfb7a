"""A colour model of the background that changes with the place: sky gradients, horizon, neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.colour_model import NOISE, Mixture, log_sum

CELLS = 64  # of the coarse grid, across the window's longer side
REACH = ((0.04, 0.04, 1.0), (0.24, 0.08, 0.1), (0.6, 0.3, 0.01))  # (sigma across, up; weight) of the kernel's parts
ELSEWHERE = 0.2  # share of each colour's pixels that keep its spread over the whole ring, wherever they are
PEAK, LEAST = 13.0, 1e-37  # no density exceeds e^13 (a Gaussian as narrow as NOISE); less than LEAST e^13 is nothing
EXPECTED = 0.05  # weight of a colour in the known background around, from which a gap of that colour is believed
ANCHOR = 0.003  # what the mixture as a whole counts against local samples: keeps every known colour possible


@dataclass(frozen=True, eq=False)
class BackgroundField:
    """K Gaussians whose weights and means vary over a coarse grid of the window (a x b cells)."""

    weight: NDArray[np.float32]  # (a, b, K) adds up to 1
    mean: NDArray[np.float32]  # (a, b, K, 3)
    precision_root: NDArray[np.float32]  # (K, 3, 3): its square is the inverse covariance
    log_scale: NDArray[np.float32]  # (K,) log of each Gaussian's peak density
    anywhere: Mixture  # the same K colours without a place

    def log_density(self, rgb: NDArray[np.float32]) -> NDArray[np.float32]:
        """Log density of each pixel's colour (h, w, 3) under the model of its own place: (h, w)."""
        size = rgb.shape[1::-1]
        anywhere = self.anywhere.joint_log_density(rgb.reshape(-1, 3)).T
        density = np.zeros(rgb.shape[:2], np.float32)
        for k, root in enumerate(self.precision_root):
            mean = cv2.resize(self.mean[:, :, k], size, interpolation=cv2.INTER_LINEAR)
            away = cv2.transform(rgb - mean, root)
            here = np.float32(-0.5) * np.einsum("hwi,hwi->hw", away, away) + self.log_scale[k]
            there = anywhere[k].reshape(density.shape)
            weight = cv2.resize(self.weight[:, :, k], size, interpolation=cv2.INTER_LINEAR)
            share = np.float32(ELSEWHERE / self.anywhere.weight[k])
            density += weight * ((1 - np.float32(ELSEWHERE)) * np.exp(here - PEAK) + share * np.exp(there - PEAK))
        return np.asarray(np.log(np.maximum(density, np.float32(LEAST))) + np.float32(PEAK))


def spread_background(
    rgb: NDArray[np.float32],
    certainty: NDArray[np.float32],
    is_known: NDArray[np.bool_],
    is_open: NDArray[np.bool_],
    model: Mixture,
) -> BackgroundField:
    """Let a mixture follow the place: at each cell, what the samples near it say.

    `certainty` (h, w) in [0, 1] says how surely each pixel is background: the colours are learnt
    from all of it. Which of them occur where is learnt from what is background for certain
    (`is_known`) and, as far as that lets them expect there, from open gaps in the crown (`is_open`):
    a dark spot among the leaves must not make darkness likely around it. A sample's say falls off
    with distance like a sum of Gaussians (REACH): it never ends, and near ones win.
    """
    h, w = certainty.shape
    cells = [max(1, round(side * CELLS / max(h, w))) for side in (h, w)]
    row, column = np.nonzero(certainty > 0.05)
    colour = rgb[row, column]
    joint = model.joint_log_density(colour)
    share = np.exp(joint - log_sum(joint)[:, None]) * certainty[row, column][:, None]
    cell = row * cells[0] // h * cells[1] + column * cells[1] // w
    n = cells[0] * cells[1]

    def gather(value: NDArray[np.float32]) -> NDArray[np.float32]:
        grid = np.stack([np.bincount(cell, v, n) for v in value.T], axis=1).reshape(*cells, -1)
        return _spread(grid.astype(np.float32))

    near = gather(share)[..., None] + 1e-9
    first = gather((share[:, :, None] * colour[:, None]).reshape(len(colour), -1))
    mean = (first.reshape(*cells, len(model), 3) + 1e-9 * model.mean) / near
    around = gather(share * is_known[row, column][:, None])
    expected = (around / np.maximum(around.sum(axis=2, keepdims=True), 1e-12)).reshape(n, -1)[cell]
    trusted = np.where(is_known[row, column][:, None], 1, np.minimum(expected / EXPECTED, 1))
    occurs = gather(share * is_open[row, column][:, None] * trusted)
    weight = (occurs / np.maximum(occurs.sum(axis=2, keepdims=True), 1e-12) + ANCHOR * model.weight) / (1 + ANCHOR)
    fitted = mean.reshape(n, len(model), 3)[cell]
    away = colour[:, None] - fitted
    covariance = np.einsum("nk,nki,nkj->kij", share, away, away, optimize=True) / (
        share.sum(axis=0)[:, None, None] + 1e-9
    )
    covariance += NOISE**2 * np.eye(3)
    value, vector = np.linalg.eigh(covariance)
    root = np.einsum("kij,kj,klj->kil", vector, value**-0.5, vector)
    log_scale = -0.5 * np.log(2 * np.pi * value).sum(axis=1)
    return BackgroundField(
        weight.astype(np.float32), mean.astype(np.float32), root.astype(np.float32), log_scale.astype(np.float32), model
    )


def _spread(grid: NDArray[np.float32]) -> NDArray[np.float32]:
    """A grid (a, b, C) smoothed by a kernel with a sharp peak and far tails."""
    out = np.zeros_like(grid)
    for across, up, weight in REACH:
        reach = max(grid.shape[:2])
        for c in range(grid.shape[2]):
            layer = np.ascontiguousarray(grid[..., c])
            out[..., c] += weight * cv2.GaussianBlur(
                layer, (0, 0), across * reach, sigmaY=up * reach, borderType=cv2.BORDER_CONSTANT
            )
    return out
