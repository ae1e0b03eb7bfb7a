"""Rays of the views through the voxels: what each coarse square of a photo says of the density behind it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from forestgen.arrays import freeze
from forestgen.camera import Camera
from forestgen.tree.density import DensityVolume

OPAQUE = 0.98  # a square covered more than this tells only that it is dense: there its optical depth is 3.9


@dataclass(frozen=True, eq=False)
class Raster:
    """A photo's values in squares as large as a voxel seen at the root's depth. R rows, C columns."""

    value: NDArray[np.float64]  # (R, C) mean over the square; what lies outside the photo counts as 0
    camera: Camera
    corner: tuple[float, float]  # px, top left corner of square (0, 0)
    square: float  # px, side of a square

    def __post_init__(self) -> None:
        freeze(self, value=(np.float64, "R", "C"))

    def place(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Row and column (N, 2), not rounded, where points (N, 3) fall; the middle of square (0, 0) is (0, 0)."""
        return np.asarray((self.camera.project(points)[:, ::-1] - self.corner[::-1]) / self.square - 0.5)

    def nearest(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Index (N,) into `value.ravel()` of the squares that points (N, 3) fall in, and whether they do (N,)."""
        row, column = np.floor(self.place(points) + 0.5).astype(np.int64).T
        inside = (row >= 0) & (column >= 0) & (row < self.value.shape[0]) & (column < self.value.shape[1])
        return np.where(inside, row * self.value.shape[1] + column, 0), inside

    def at(self, points: NDArray[np.float64], *, outside: float = 0.0) -> NDArray[np.float64]:
        """Values (N,) of the squares that points (N, 3) fall in."""
        index, inside = self.nearest(points)
        return np.where(inside, self.value.ravel()[index], outside)


def rasterise(image: NDArray[np.float64], camera: Camera, grid: DensityVolume) -> Raster:
    """Means of an image (H, W) over squares that line up with the grid's voxels where the view is along an axis."""
    square = grid.edge * camera.px_per_metre
    lattice = np.array([camera.root_px[0] + grid.low[0] * camera.px_per_metre, camera.root_px[1]])
    corner = lattice - np.ceil(lattice / square) * square  # at or before the photo's own corner
    columns, rows = np.ceil((np.array(image.shape[::-1]) - corner) / square).astype(int)
    means = _means(image.T, corner[0], square, columns)
    return Raster(_means(means.T, corner[1], square, rows), camera, (float(corner[0]), float(corner[1])), square)


def _means(lines: NDArray[np.float64], start: float, step: float, count: int) -> NDArray[np.float64]:
    """Means (count, M) of lines (L, M) over intervals of `step` lines; fractions count, beyond the ends is 0."""
    summed = np.vstack([np.zeros(lines.shape[1]), np.cumsum(lines, axis=0, dtype=np.float64)])
    ends = np.clip(start + step * np.arange(count + 1), 0, len(lines))
    whole = np.minimum(ends.astype(np.int64), len(lines) - 1)
    upto = summed[whole] + (ends - whole)[:, None] * lines[whole]
    return np.asarray(np.diff(upto, axis=0) / step)


def optical_depth(coverage: NDArray[np.float64]) -> NDArray[np.float64]:
    """-log of the transparency, as far as a photo can tell: eq. 1 of Neubert 2007 with a black background."""
    return np.asarray(-np.log1p(-np.minimum(coverage, OPAQUE)))


def ray_matrix(raster: Raster, points: NDArray[np.float64]) -> csr_array:
    """How much of the optical depth of voxels at points (N, 3) each square sees (R * C, N).

    The product of the transparencies along a ray (eq. 1) is a sum of optical depths. A voxel's depth is shared
    among the four squares about its image; in a view along an axis it falls on one.
    """
    row, column = raster.place(points).T
    rows, columns = raster.value.shape
    shrink = np.ones(len(points))
    if raster.camera.focal_px is not None:
        shrink = (raster.camera.distance / (raster.camera.distance - raster.camera.depth(points))) ** 2
    first_row, first_column = np.floor(row + 1e-9).astype(np.int64), np.floor(column + 1e-9).astype(np.int64)
    down, across = np.maximum(row - first_row, 0), np.maximum(column - first_column, 0)
    index, voxel, weight = [], [], []
    for r, c, share in (
        (first_row, first_column, (1 - down) * (1 - across)),
        (first_row, first_column + 1, (1 - down) * across),
        (first_row + 1, first_column, down * (1 - across)),
        (first_row + 1, first_column + 1, down * across),
    ):
        seen = np.flatnonzero((r >= 0) & (c >= 0) & (r < rows) & (c < columns) & (share > 1e-6))
        index.append(r[seen] * columns + c[seen])
        voxel.append(seen)
        weight.append((share * shrink)[seen])
    entries = (np.concatenate(weight), (np.concatenate(index), np.concatenate(voxel)))
    return csr_array(coo_array(entries, shape=(raster.value.size, len(points))))
