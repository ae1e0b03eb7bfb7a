"""Density of a tree from its views: at first the least that any view shows (Neubert et al. 2007, sec. 5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forestgen.errors import StageError
from forestgen.tree.density import DensityVolume
from forestgen.tree.scale import own_part
from forestgen.tree.view import View

THRESHOLD = 0.05  # sec. 5 rejects voxels "below a predefined threshold" that it does not give


def estimate_density(views: Sequence[View], *, resolution: int = 64) -> DensityVolume:
    """Density volume of the tree that the views show, `resolution` voxels along its longest side.

    Raises:
        StageError: no voxel is tree in every view.
    """
    images = [view_density(view) for view in views]
    low, edge, shape = _grid(views, images, resolution)
    empty = DensityVolume(np.zeros(shape), low, edge)
    alpha = np.min([mean_seen(i, v, empty) for i, v in zip(images, views, strict=True)], axis=0)
    alpha[alpha < THRESHOLD] = 0.0
    if not alpha.any():
        names = ", ".join(view.photo.name for view in views)
        raise StageError(f"{names}: no place in space is tree in all views: check their azimuths, roots and scales")
    return DensityVolume(alpha.reshape(shape), low, edge)


def view_density(view: View) -> NDArray[np.float64]:
    """How much of each pixel (H, W) is this tree, in [0, 1]: its matte read as density (sec. 4)."""
    mattes = view.mattes
    total = np.minimum(mattes.foliage.astype(np.float64) + mattes.branch, 1.0)
    own = own_part(mattes.is_tree, view.strokes)
    return np.where(own | ~mattes.is_tree, total, 0.0)


def mean_seen(image: NDArray[np.float64], view: View, grid: DensityVolume) -> NDArray[np.float64]:
    """Mean density (N,) of the square that each voxel covers in an image (H, W); N voxels."""
    summed = np.zeros((image.shape[0] + 1, image.shape[1] + 1))
    summed[1:, 1:] = image.cumsum(axis=0).cumsum(axis=1)
    half = 0.5 * grid.edge * view.camera.px_per_metre
    xy = view.camera.project(grid.centres())
    limit = np.array(image.shape[::-1])
    left, top = np.clip(np.round(xy - half), 0, limit).astype(np.int64).T
    right, bottom = np.clip(np.round(xy + half), 0, limit).astype(np.int64).T
    total = summed[bottom, right] - summed[top, right] - summed[bottom, left] + summed[top, left]
    area = np.maximum((np.ceil(2 * half)) ** 2, (right - left) * (bottom - top))  # what lies outside the photo is empty
    return np.asarray(np.minimum(total / area, 1.0))


def _grid(
    views: Sequence[View], images: Sequence[NDArray[np.float64]], resolution: int
) -> tuple[NDArray[np.float64], float, tuple[int, int, int]]:
    """Corner, edge and shape of a grid about everything that any view shows."""
    widest, highest = 0.0, 0.0
    for view, image in zip(views, images, strict=True):
        row, column = np.nonzero(image > THRESHOLD)
        if not len(row):
            raise StageError(f"{view.photo.name}: this view shows nothing of the tree")
        local = view.camera.unproject(np.column_stack([column + 0.5, row + 0.5])) @ view.camera.axes.T
        widest, highest = max(widest, float(np.abs(local[:, 0]).max())), max(highest, float(local[:, 1].max()))
    edge = max(2 * widest, highest) / resolution
    across, up = int(np.ceil(2 * widest / edge)), int(np.ceil(highest / edge))
    return np.array([-0.5 * across * edge, 0.0, -0.5 * across * edge]), edge, (across, up, across)
