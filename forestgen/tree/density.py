"""DensityVolume: how much of a tree's biomass lies where in space, as voxels (Neubert et al. 2007, sec. 5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze


@dataclass(frozen=True, eq=False)
class DensityVolume:
    """Cubic voxels in the tree's own space. I, J, K voxels along x, y (up) and z; 0 is empty."""

    alpha: NDArray[np.float64]  # (I, J, K) opacity of each voxel in [0, 1], seen along one of its edges
    low: NDArray[np.float64]  # (3,) m, the corner of voxel (0, 0, 0) with the least coordinates
    edge: float  # m, of a voxel

    def __post_init__(self) -> None:
        freeze(self, alpha=(np.float64, "I", "J", "K"), low=(np.float64, 3))
        if self.alpha.size and not (self.alpha.min() >= 0 and self.alpha.max() <= 1):
            raise ValueError(f"DensityVolume.alpha must lie in [0, 1]; came {self.alpha.min()} to {self.alpha.max()}")
        if not self.edge > 0:
            raise ValueError(f"DensityVolume.edge is {self.edge}; expected a positive number of metres")

    @property
    def is_filled(self) -> NDArray[np.bool_]:
        """Which voxels (I, J, K) hold anything."""
        return self.alpha > 0

    def centres(self, wanted: NDArray[np.bool_] | None = None) -> NDArray[np.float64]:
        """Middles (N, 3) of all voxels, or of the wanted ones (I, J, K), metres, in the order of `alpha.ravel()`."""
        wanted = np.ones(self.alpha.shape, bool) if wanted is None else wanted
        return np.column_stack([self.low[k] + (cell + 0.5) * self.edge for k, cell in enumerate(np.nonzero(wanted))])

    def at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Opacity (N,) of the voxels that hold points (N, 3); 0 outside the grid."""
        cell = np.floor((points - self.low) / self.edge).astype(np.int64)
        inside = np.all((cell >= 0) & (cell < self.alpha.shape), axis=1)
        i, j, k = np.where(inside[:, None], cell, 0).T
        return np.where(inside, self.alpha[i, j, k], 0.0)

    def sample(self, count: int, *, rng: np.random.Generator) -> NDArray[np.float64]:
        """Points (count, 3), metres, in proportion to density (Neubert 2007, sec. 6), anywhere in their voxels.

        Raises:
            ValueError: no voxel is filled.
        """
        weight = self.alpha.ravel()
        if not weight.any():
            raise ValueError("DensityVolume.sample: every voxel is empty")
        ends = np.cumsum(weight)
        pick = np.searchsorted(ends, rng.random(count) * ends[-1], side="right")
        cell = np.column_stack(np.unravel_index(np.minimum(pick, len(ends) - 1), self.alpha.shape))
        return np.asarray(self.low + (cell + rng.random((count, 3))) * self.edge)
