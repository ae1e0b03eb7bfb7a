"""Density of a tree from its views (Neubert et al. 2007, sec. 5): a first guess, then what the photos' depths ask.

As printed (`prior=False`): voxels start from the least mean density that any view shows, sparse ones are carved
away, and the log-linear system of the rays is solved in the least-squares sense. Two views leave most of the
volume open to choice: the hull's corners stay filled. With the prior the crown is rounded
(`density_shape`), and of all densities in it that explain the photos the one nearest to the first guess is taken.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import vstack

from forestgen.errors import StageError
from forestgen.tree.density import DensityVolume
from forestgen.tree.density_rays import Raster, optical_depth, rasterise, ray_matrix
from forestgen.tree.density_shape import is_one_sided, shape_crown, side_silhouette, silhouette
from forestgen.tree.density_solve import least_squares, most_even
from forestgen.tree.scale import LINK, disc, own_part
from forestgen.tree.view import View

RESOLUTION = 128  # sec. 5 has 25: a voxel of 4 % of the tree, whose outline scores 0.85; of this one 0.97
THRESHOLD = 0.05  # sec. 5 rejects voxels "below a predefined threshold" that it does not give
EXPLAINED = 0.5  # share of a silhouette that the other views must leave room for


def estimate_density(
    views: Sequence[View], *, resolution: int = RESOLUTION, refine: bool = True, prior: bool = True
) -> DensityVolume:
    """Density volume of the tree that the views show, `resolution` voxels along its longest side.

    `refine` solves for the densities that explain the photos (else: the first guess); `prior` takes the crown
    for round where no view tells.

    Raises:
        StageError: the views contradict each other, or one shows nothing of the tree, or a solver did not settle.
    """
    images = [view_density(view) for view in views]
    grid = _grid(views, images, resolution)
    filled = _shape(views, images, grid) if prior else np.ones(grid.alpha.shape, bool)
    alpha = least_seen(images, views, grid, filled)
    alpha[alpha < THRESHOLD] = 0.0
    if prior:
        alpha[filled] = np.maximum(alpha[filled], THRESHOLD)  # a small gap, or views that disagree a little
    rasters = [rasterise(image, view.camera, grid) for image, view in zip(images, views, strict=True)]
    _check_explained(views, rasters, alpha, grid)
    return solve(alpha, rasters, grid, prior=prior) if refine else DensityVolume(alpha, grid.low, grid.edge)


def least_seen(
    images: Sequence[NDArray[np.float64]], views: Sequence[View], grid: DensityVolume, filled: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Minimum over the views of the mean density of each filled voxel's projected area (I, J, K)."""
    points = grid.centres(filled)
    alpha = np.zeros(filled.shape)
    seen = [mean_seen(i, v, grid, points) for i, v in zip(images, views, strict=True)]
    alpha[filled] = np.min(seen, axis=0)
    return alpha


def solve(alpha: NDArray[np.float64], rasters: Sequence[Raster], grid: DensityVolume, *, prior: bool) -> DensityVolume:
    """Refine a first guess (I, J, K) so that the voxels' transparencies multiply to those of the photos (eq. 1)."""
    filled = alpha > 0
    points = grid.centres(filled)
    rays = vstack([ray_matrix(raster, points) for raster in rasters], format="csr")
    seen = np.concatenate([optical_depth(raster.value.ravel()) for raster in rasters])
    depth = (most_even if prior else least_squares)(rays, seen, optical_depth(alpha[filled]))
    refined = np.zeros(alpha.shape)
    refined[filled] = -np.expm1(-depth)
    return DensityVolume(refined, grid.low, grid.edge)


def density_steps(
    views: Sequence[View], *, resolution: int = 25, prior: bool = False
) -> tuple[DensityVolume, DensityVolume, list[tuple[NDArray[np.float64], NDArray[np.float64]]]]:
    """What figure 3 shows: the first guess, the refined volume, and per view the squares seen and drawn (R, C)."""
    first = estimate_density(views, resolution=resolution, refine=False, prior=prior)
    refined = estimate_density(views, resolution=resolution, prior=prior)
    return first, refined, [seen_and_drawn(refined, view) for view in views]


def density_residual(volume: DensityVolume, views: Sequence[View]) -> NDArray[np.float64]:
    """Per view (V,) the RMS difference of coverage between photo and volume, over the squares where either shows."""
    return np.array([_rms(*seen_and_drawn(volume, view)) for view in views])


def seen_and_drawn(volume: DensityVolume, view: View) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Coverage (R, C), in [0, 1], of squares as large as a voxel: in the photo, and of the volume drawn likewise."""
    raster = rasterise(view_density(view), view.camera, volume)
    rays = ray_matrix(raster, volume.centres(volume.is_filled))
    drawn = -np.expm1(-(rays @ optical_depth(volume.alpha[volume.is_filled])))
    return raster.value, drawn.reshape(raster.value.shape)


def _rms(seen: NDArray[np.float64], drawn: NDArray[np.float64]) -> float:
    shows = (seen > THRESHOLD) | (drawn > THRESHOLD)
    return float(np.sqrt(np.mean((seen - drawn)[shows] ** 2))) if shows.any() else 0.0


def view_density(view: View) -> NDArray[np.float64]:
    """How much of each pixel (H, W) is this tree, in [0, 1]: its matte read as density (sec. 4).

    Half-covered pixels count only near the tree's own part: a soft matte elsewhere is another's.
    """
    total = np.minimum(view.mattes.foliage.astype(np.float64) + view.mattes.branch, 1.0)
    own = own_part(view.mattes.is_tree, view.strokes)
    rows = np.flatnonzero(own.any(axis=1))
    if not len(rows):
        return np.zeros_like(total)
    near = cv2.dilate(own.astype(np.uint8), disc(LINK / 2 * (rows[-1] - rows[0]))) > 0
    return np.where(own | (near & ~view.mattes.is_tree), total, 0.0)


def mean_seen(
    image: NDArray[np.float64], view: View, grid: DensityVolume, points: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Mean density (N,) of the box that each voxel's image fills in a view's picture (H, W).

    Voxels are those of the grid, or stand about `points` (N, 3). The box is the voxel's true image where the
    camera is level; seen from above it also holds the hexagon's two missing corners.
    """
    points = grid.centres() if points is None else points
    camera = view.camera
    summed = np.zeros((image.shape[0] + 1, image.shape[1] + 1))
    summed[1:, 1:] = image.cumsum(axis=0).cumsum(axis=1)
    half = 0.5 * grid.edge * camera.px_per_metre * np.abs(camera.axes[:2]).sum(axis=1)
    if camera.focal_px is not None:
        half = half * (camera.distance / (camera.distance - camera.depth(points)))[:, None]
    xy = camera.project(points)
    limit = np.array(image.shape[::-1])
    left, top = np.clip(np.round(xy - half), 0, limit).astype(np.int64).T
    right, bottom = np.clip(np.round(xy + half), 0, limit).astype(np.int64).T
    total = summed[bottom, right] - summed[top, right] - summed[bottom, left] + summed[top, left]
    area = np.maximum(np.prod(2 * half, axis=-1), (right - left) * (bottom - top))  # outside the photo is empty
    return np.asarray(np.clip(total / area, 0.0, 1.0))


def _shape(views: Sequence[View], images: Sequence[NDArray[np.float64]], grid: DensityVolume) -> NDArray[np.bool_]:
    """Which voxels (I, J, K) the rounded crown fills."""
    height = grid.edge * grid.alpha.shape[1]
    outlines = [silhouette(image, view.camera, grid, height) for image, view in zip(images, views, strict=True)]
    if is_one_sided([view.camera for view in views]):
        outlines.append(side_silhouette(outlines[0], height, grid.edge))
    return shape_crown(outlines, grid, height)


def _check_explained(
    views: Sequence[View], rasters: Sequence[Raster], alpha: NDArray[np.float64], grid: DensityVolume
) -> None:
    """Refuse views that leave each other hardly any room."""
    points = grid.centres(alpha > 0)
    for view, raster in zip(views, rasters, strict=True):
        is_tree = raster.value > THRESHOLD
        index, inside = raster.nearest(points)
        met = np.zeros(is_tree.size, np.uint8)
        met[index[inside]] = 1
        near = cv2.dilate(met.reshape(is_tree.shape), disc(1)) > 0
        share = float(near[is_tree].mean()) if is_tree.any() else 0.0  # far smaller than a square, or beside them all
        if share < EXPLAINED:
            others = ", ".join(other.photo.name for other in views if other is not view) or "its own outline"
            raise StageError(
                f"{view.photo.name}: {1 - share:.0%} of the tree in this photo has no place that is tree in {others} "
                "too: check the views' azimuth, elevation, root and scale, and that all show the same tree"
            )


def _grid(views: Sequence[View], images: Sequence[NDArray[np.float64]], resolution: int) -> DensityVolume:
    """An empty grid about everything that any view shows."""
    if resolution < 1:
        raise ValueError(f"estimate_density: resolution is {resolution}; expected at least 1 voxel")
    widest, highest = 0.0, 0.0
    for view, image in zip(views, images, strict=True):
        row, column = np.nonzero(image >= 0.5)
        if not len(row):
            raise StageError(f"{view.photo.name}: this view shows nothing of the tree")
        local = view.camera.unproject(np.column_stack([column + 0.5, row + 0.5])) @ view.camera.axes.T
        level = np.cos(view.camera.elevation)
        widest, highest = max(widest, float(np.abs(local[:, 0]).max())), max(highest, float(local[:, 1].max() / level))
    edge = max(2 * widest, highest) / resolution
    across, up = int(np.ceil(2 * widest / edge - 1e-9)), int(np.ceil(highest / edge - 1e-9))
    low = np.array([-0.5 * across * edge, 0.0, -0.5 * across * edge])
    return DensityVolume(np.zeros((across, up, across)), low, edge)
