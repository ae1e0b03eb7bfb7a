"""A colour model of the background that changes with the place: sky gradients, horizon, neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.colour_model import NOISE, Mixture, log_sum

CELLS = 64  # of the coarse grid, across the window's longer side
REACH = ((0.04, 1.0), (0.12, 0.1), (0.36, 0.01))  # (sigma as a share of the window, weight) of the kernel's parts
ANCHOR = 0.003  # what the mixture as a whole counts against local samples: keeps every known colour possible


@dataclass(frozen=True, eq=False)
class BackgroundField:
    """K Gaussians whose weights and means vary over a coarse grid of the window (a x b cells)."""

    weight: NDArray[np.float32]  # (a, b, K) adds up to 1
    mean: NDArray[np.float32]  # (a, b, K, 3)
    precision_root: NDArray[np.float32]  # (K, 3, 3): its square is the inverse covariance
    log_scale: NDArray[np.float32]  # (K,) log of each Gaussian's peak density

    def log_density(self, rgb: NDArray[np.float32]) -> NDArray[np.float32]:
        """Log density of each pixel's colour (h, w, 3) under the model of its own place: (h, w)."""
        size = rgb.shape[1::-1]
        joint = np.empty((*rgb.shape[:2], len(self.log_scale)), np.float32)
        for k, root in enumerate(self.precision_root):
            z = (rgb - cv2.resize(self.mean[:, :, k], size, interpolation=cv2.INTER_LINEAR)) @ root
            weight = cv2.resize(self.weight[:, :, k], size, interpolation=cv2.INTER_LINEAR)
            joint[..., k] = np.log(weight) + self.log_scale[k] - 0.5 * np.einsum("hwi,hwi->hw", z, z)
        return log_sum(joint)


def spread_background(rgb: NDArray[np.float32], certainty: NDArray[np.float32], model: Mixture) -> BackgroundField:
    """Let a mixture follow the place: at each cell, what the samples near it say.

    `certainty` (h, w) in [0, 1] says how surely each pixel is background. A sample's say falls off
    with distance like a sum of Gaussians (REACH), so it never ends, and near ones win.
    """
    h, w = certainty.shape
    step = max(1, round(max(h, w) / CELLS))
    cells = (-(-w // step), -(-h // step))
    sample = np.flatnonzero(certainty.ravel() > 0.05)
    colour = rgb.reshape(-1, 3)[sample]
    joint = model.joint_log_density(colour)
    share = np.exp(joint - log_sum(joint)[:, None]) * certainty.ravel()[sample][:, None]
    cell = (sample // w) // step * cells[0] + (sample % w) // step
    n = cells[0] * cells[1]
    mass = np.stack([np.bincount(cell, s, n) for s in share.T], axis=1)
    first = np.stack([np.stack([np.bincount(cell, s * c, n) for c in colour.T], axis=1) for s in share.T], axis=1)
    grid = np.concatenate([mass[..., None], first], axis=2).reshape(cells[1], cells[0], -1)
    smooth = _spread(grid.astype(np.float32)).reshape(cells[1], cells[0], len(model), 4)
    smooth /= np.maximum(smooth[..., 0].sum(axis=2).max(), 1e-12)  # densest place = 1
    near = smooth[..., 0] + 1e-6
    mean = (smooth[..., 1:] + 1e-6 * model.mean) / near[..., None]
    total = near.sum(axis=2, keepdims=True)
    weight = (near / total + ANCHOR * model.weight) / (1 + ANCHOR)
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
        weight.astype(np.float32), mean.astype(np.float32), root.astype(np.float32), log_scale.astype(np.float32)
    )


def _spread(grid: NDArray[np.float32]) -> NDArray[np.float32]:
    """A grid (a, b, C) smoothed by a kernel with a sharp peak and far tails."""
    out = np.zeros_like(grid)
    pad = max(grid.shape[:2])
    for sigma, weight in REACH:
        wide = np.pad(grid, ((0, 0), (0, 0), (0, 0)))
        for c in range(grid.shape[2]):
            blurred = cv2.GaussianBlur(
                np.ascontiguousarray(wide[..., c]), (0, 0), sigma * pad, borderType=cv2.BORDER_CONSTANT
            )
            out[..., c] += weight * blurred
    return out
