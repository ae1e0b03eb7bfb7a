"""BranchGraph: the branches that are visible in one photo, in pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.skeleton import is_topological


@dataclass(frozen=True, eq=False)
class BranchGraph:
    """A rooted graph traced in a photo. N nodes; node 0 is the root, on the first trunk stroke's start."""

    xy: NDArray[np.float64]  # (N, 2) px
    parent: NDArray[np.int64]  # (N,) parent[0] == -1, else parent[i] < i
    radius_px: NDArray[np.float64]  # (N,) half the branch's width, NaN where it was not measured

    def __post_init__(self) -> None:
        freeze(self, xy=(np.float64, "N", 2), parent=(np.int64, "N"), radius_px=(np.float64, "N"))
        if not is_topological(self.parent):
            raise ValueError("node 0 must be the only root, and parents must come before their children")

    def __len__(self) -> int:
        return len(self.parent)
