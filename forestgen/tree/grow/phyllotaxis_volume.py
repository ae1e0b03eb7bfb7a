"""The crown for twigs: what all silhouettes allow, and in it where the density volume holds anything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from forestgen.camera import Camera
from forestgen.tree.density import DensityVolume
from forestgen.tree.density_views import estimate_density
from forestgen.tree.grow.crown_volume import CrownVolume, crown_volume
from forestgen.tree.grow.leaf_masses import LeafMasses
from forestgen.tree.view import View


def dense_volume(views: Sequence[View], resolution: int) -> CrownVolume:
    """The crown's volume; twigs end only where voxels are filled, `resolution` of them along its longest side.

    Raises:
        StageError: a view shows no crown, or no voxel is tree in every view.
    """
    volume = crown_volume(views)
    density = estimate_density(views, resolution=resolution)
    return replace(volume, masses=masses_of(density, views[0].camera))


def masses_of(density: DensityVolume, camera: Camera) -> LeafMasses:
    """A density volume's filled voxels as cells along a camera's axes, half as large."""
    cell = 0.5 * density.edge
    corner = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) * density.alpha.shape
    local = (density.low + corner * density.edge) @ camera.axes.T
    low = local.min(axis=0)
    count = np.maximum(1, np.ceil((local.max(axis=0) - low) / cell - 1e-9).astype(np.int64))
    index = np.stack(np.meshgrid(*[np.arange(n) for n in count], indexing="ij"), axis=-1).reshape(-1, 3)
    filled = (density.at((low + (index + 0.5) * cell) @ camera.axes) > 0).reshape(count)
    foremost = count[2] - 1 - filled[:, :, ::-1].argmax(axis=2)
    front = np.where(filled.any(axis=2), low[2] + (foremost + 1) * cell, -np.inf)
    centre = density.centres()[density.is_filled.ravel()]
    return LeafMasses(centre, np.full(len(centre), 0.5 * density.edge), camera.axes, low, cell, filled, front)
