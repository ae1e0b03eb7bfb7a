"""Camera: where a point of the tree's own space falls in a photo, and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Camera:
    """A view of one tree. Tree space: metres, Y up, the root at the origin.

    The camera stands at `azimuth` (radians, anticlockwise about +Y seen from above; 0 = on the +Z
    side) and at `elevation` (radians above the horizon), and looks at the tree. Without a focal
    length it is orthographic, as in the papers; with one, `px_per_metre` holds at the root's
    depth and the principal point is the middle of the photo.

    Pixels: x right, y down, origin at the top-left corner of the top-left pixel.
    """

    size: tuple[int, int]  # (width, height) of the photo, px
    root_px: tuple[float, float]  # where the tree's origin falls, px
    px_per_metre: float
    azimuth: float = 0.0
    elevation: float = 0.0
    focal_px: float | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.px_per_metre) and self.px_per_metre > 0):
            raise ValueError(f"Camera.px_per_metre is {self.px_per_metre}; expected a positive number")
        if self.focal_px is not None and not self.focal_px > 0:
            raise ValueError(f"Camera.focal_px is {self.focal_px}; expected a positive number or None")

    @property
    def axes(self) -> NDArray[np.float64]:
        """Rows: the photo's right, its up, and the direction from the tree to the camera (3, 3)."""
        ca, sa = np.cos(self.azimuth), np.sin(self.azimuth)
        ce, se = np.cos(self.elevation), np.sin(self.elevation)
        return np.array([[ca, 0.0, -sa], [-sa * se, ce, -ca * se], [sa * ce, se, ca * ce]])

    @property
    def distance(self) -> float:
        """Metres from the camera to the root's plane; infinite when orthographic."""
        return np.inf if self.focal_px is None else self.focal_px / self.px_per_metre

    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        """Pixels (N, 2) of points (N, 3) in metres."""
        local = np.asarray(points, float) @ self.axes.T
        root, centre = np.array(self.root_px), np.array(self.size) / 2
        flat = local[:, :2] * [1.0, -1.0] * self.px_per_metre
        if self.focal_px is None:
            return root + flat
        shrink = self.distance / (self.distance - local[:, 2])
        return centre + (root - centre + flat) * shrink[:, None]

    def depth(self, points: ArrayLike) -> NDArray[np.float64]:
        """Metres (N,) by which points (N, 3) are nearer to the camera than the root's plane."""
        return np.asarray(np.asarray(points, float) @ self.axes[2])

    def unproject(self, xy: ArrayLike, depth: ArrayLike = 0.0) -> NDArray[np.float64]:
        """Points (N, 3) in metres that fall on pixels (N, 2) at the given depth (N,), metres."""
        xy = np.asarray(xy, float)
        depth = np.broadcast_to(np.asarray(depth, float), xy.shape[:1])
        root, centre = np.array(self.root_px), np.array(self.size) / 2
        if self.focal_px is None:
            flat = xy - root
        else:
            shrink = self.distance / (self.distance - depth)
            flat = (xy - centre) / shrink[:, None] + centre - root
        local = np.column_stack([flat * [1.0, -1.0] / self.px_per_metre, depth])
        return np.asarray(local @ self.axes)
