"""Attractors: points that each want a branch near them (Tan et al. 2008, sec. 3.2).

Points of an image are kept as (x, y, 0) in metres of the picture, so that one set of distance loops serves all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.tree.grow import kernels


@dataclass(eq=False)
class Field:
    """Attractors and how far each is from the growing tree. S points; more may be added."""

    point: NDArray[np.float64]  # (S, 3)
    distance: NDArray[np.float64]  # (S,) to the nearest segment of the tree

    def __len__(self) -> int:
        return len(self.distance)

    @property
    def cost(self) -> float:
        """E(T), the sum of all distances, metres."""
        return float(self.distance.sum())

    def add(self, point: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]) -> None:
        """Add attractors (N, 3), measured against the tree's segments (M, 3), (M, 3)."""
        self.point = np.concatenate([self.point, point])
        self.distance = np.concatenate([self.distance, kernels.distance_to_segments(point, a, b)])

    def grow(self, a: NDArray[np.float64], b: NDArray[np.float64]) -> None:
        """Lower the distances for new segments: d(n + 1) = min(d(n), distance to what is new)."""
        kernels.lower_distances(a, b, self.point, self.distance)


def empty_field() -> Field:
    return Field(np.zeros((0, 3)), np.zeros(0))


def picture_plane(camera: Camera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where points (N, 3) fall in a photo, as (N, 3): x, y in metres at the root's scale, and 0."""
    xy = camera.project(points) / camera.px_per_metre
    return np.column_stack([xy, np.zeros(len(xy))])


def image_attractors(region: NDArray[np.bool_], camera: Camera, interval: float) -> NDArray[np.float64]:
    """Points (N, 3) of the picture plane, evenly in a region (H, W): every `interval` metres each way."""
    step = max(1.0, interval * camera.px_per_metre)
    columns = np.arange(step / 2, region.shape[1], step)
    rows = np.arange(step / 2, region.shape[0], step)
    x, y = (grid.ravel() for grid in np.meshgrid(columns, rows))
    kept = region[y.astype(int), x.astype(int)]
    return np.column_stack([x[kept], y[kept], np.zeros(int(kept.sum()))]) / camera.px_per_metre


def turn_about(points: NDArray[np.float64], axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (N, 3) turned by 90 degrees about a unit axis (3,) through the root."""
    along = points @ axis
    return np.asarray(np.cross(axis, points) + along[:, None] * axis)
