"""Turned outline: the depth that a crown has when its outline in one photo is turned about the trunk."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from forestgen.camera import Camera

SMOOTH = 0.03  # of the height, along it: the unseen outline does not repeat the seen one's notches
RIM = 0.08  # of the squared half-width: what thickness is left at the outline
COARSER = 3  # of so many pixels, across and down, one is looked at for the crown's spread
FLAT = 1.03  # ratio of the squared spreads, across over in depth, from which on a crown is deepened
DEEPEST = 1.2  # at most, over the depth that turning gives
PROFILE = 512  # heights at which the turned outline is kept


@dataclass(frozen=True, eq=False)
class TurnedOutline:
    """The outline of a view's envelope about the trunk; its camera's axes, metres. R heights."""

    axes: NDArray[np.float64]  # (3, 3) right, up, toward the camera
    up: NDArray[np.float64]  # (R,) rising by even steps
    centre: NDArray[np.float64]  # (R,) of the trunk, along right
    left: NDArray[np.float64]  # (R,) half-widths, 0 where there is no crown
    right: NDArray[np.float64]  # (R,)
    depth: NDArray[np.float64]  # (R,)

    def contains(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points (N, 3) lie within the depth that the turned outline has at their place (N,)."""
        across, up, toward = (points @ self.axes.T).T
        return np.asarray((np.abs(toward) <= self.reach(across, up)) & (up >= self.up[0]) & (up <= self.up[-1]))

    def reach(self, across: NDArray[np.float64], up: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far from the trunk's plane, to the camera and away from it, the crown reaches at places (N,), (N,)."""
        row = self.row(up)
        off = across - self.centre[row]
        side = np.where(off < 0, self.left[row], self.right[row])
        share = 1 - (off / np.maximum(side, 1e-9)) ** 2
        return np.asarray(self.depth[row] * np.sqrt(np.maximum(share, RIM)))

    def azimuth(self, local: NDArray[np.float64]) -> NDArray[np.float64]:
        """Angles (N,) about the trunk of points (N, 3) in the camera's axes: 0 on the right, a quarter in front."""
        return np.asarray(np.arctan2(local[:, 2], local[:, 0] - self.centre[self.row(local[:, 1])]))

    def row(self, up: NDArray[np.float64]) -> NDArray[np.int64]:
        """The profile's row (N,) at heights (N,): they are even, no search."""
        step = (self.up[-1] - self.up[0]) / (len(self.up) - 1)
        row = np.clip(np.rint((up - self.up[0]) / max(step, 1e-9)), 0, len(self.up) - 1)
        return np.asarray(row, np.int64)


def turn_outline(outline: NDArray[np.bool_], camera: Camera, height: float) -> TurnedOutline:
    """Half-widths of an envelope (H, W) about the trunk, row by row, and the depth they suggest."""
    rows = np.flatnonzero(outline.any(axis=1))
    first = outline[rows].argmax(axis=1)
    last = outline.shape[1] - outline[rows, ::-1].argmax(axis=1)
    ends = [camera.unproject(np.column_stack([x, rows + 0.5])) @ camera.axes.T for x in (first, last)]
    up, low, high = ends[0][::-1, 1], ends[0][::-1, 0], ends[1][::-1, 0]
    even = np.linspace(up[0], up[-1], PROFILE)
    low, high = np.interp(even, up, low), np.interp(even, up, high)
    quarter = 0.25 * (high - low)  # a trunk whose foot is not under its crown: turn about the crown's own middle half
    sigma = SMOOTH * height / max(even[1] - even[0], 1e-9)
    centre = gaussian_filter1d(np.clip(0.0, low + quarter, high - quarter), sigma, mode="nearest")
    left, right = np.maximum(centre - low, 0.0), np.maximum(high - centre, 0.0)
    depth = gaussian_filter1d(0.5 * (left + right), sigma, mode="nearest")
    return TurnedOutline(camera.axes, even, centre, left, right, depth)


def as_deep_as_wide(turned: TurnedOutline, leafy: NDArray[np.bool_], camera: Camera) -> TurnedOutline:
    """The turned outline, deeper where its foliage (H, W) would be less spread in depth than it is across.

    Sky about the trunk takes a crown's deepest parts away, not its widest: what is left would be flat.
    Second moments about the trunk are compared, each pixel as long as the crown is deep there.
    """
    row, column = np.nonzero(leafy[::COARSER, ::COARSER])
    local = camera.unproject(np.column_stack([column, row]) * COARSER + 0.5) @ camera.axes.T
    deep = turned.reach(local[:, 0], local[:, 1])
    off = local[:, 0] - turned.centre[turned.row(local[:, 1])]
    ratio = 3 * float((deep * off**2).sum()) / max(float((deep**3).sum()), 1e-12)
    if ratio <= FLAT:
        return turned
    return replace(turned, depth=turned.depth * min(np.sqrt(ratio), DEEPEST))
