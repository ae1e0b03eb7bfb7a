"""Mattes: how much of each pixel of a photo is foliage, and how much is wood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze


@dataclass(frozen=True, eq=False)
class Mattes:
    """Two alpha mattes of one tree in one photo, each (H, W) in [0, 1]."""

    foliage: NDArray[np.float32]  # (H, W)
    branch: NDArray[np.float32]  # (H, W)

    def __post_init__(self) -> None:
        freeze(self, foliage=(np.float32, "H", "W"), branch=(np.float32, "H", "W"))
        for name in ("foliage", "branch"):
            alpha = getattr(self, name)
            if alpha.size and not (alpha.min() >= 0 and alpha.max() <= 1):
                raise ValueError(f"Mattes.{name} must lie in [0, 1]; came {alpha.min()} to {alpha.max()}")

    @property
    def is_foliage(self) -> NDArray[np.bool_]:
        return self.foliage >= 0.5

    @property
    def is_branch(self) -> NDArray[np.bool_]:
        return self.branch >= 0.5

    @property
    def is_tree(self) -> NDArray[np.bool_]:
        """The reference silhouette (H, W): foliage or branch at 0.5."""
        return self.is_foliage | self.is_branch

    @property
    def is_bare(self) -> bool:
        """Whether this tree shows branches and not one leaf pixel."""
        return not bool(self.is_foliage.any())
