"""Seams: where a texture begins anew, points stand twice in one place. Stored meshes are closed, their texture is cut.

A point that differs from another in its texture coordinates alone is stored once, 24 bytes less; coordinates are
then stored by face corner, with an index. They keep the order that the points had: so those come back as they were.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.model import LeafPrototype, Mesh


@dataclass(frozen=True, eq=False)
class Weld:
    """Which points of a mesh are stored. P points, K of them stored."""

    kept: NDArray[np.int64]  # (K,) the point that each stored one is, rising
    stored: NDArray[np.int64]  # (P,) the stored one that each point becomes

    def __post_init__(self) -> None:
        freeze(self, kept=(np.int64, "K"), stored=(np.int64, "P"))

    @property
    def has_seams(self) -> bool:
        """Whether points stand twice."""
        return len(self.kept) < len(self.stored)


def weld(mesh: Mesh | LeafPrototype) -> Weld:
    """Find the points with the same place and normal, as float32; the first of them stands for all."""
    row = np.concatenate([mesh.points, mesh.normals], axis=1).astype(np.float32) + np.float32(0)  # no -0
    key = np.ascontiguousarray(row).view(np.uint64)  # (P, 3)
    order = np.lexsort(key.T)  # stable: equal rows stay in their order
    is_new = np.ones(len(order), bool)
    is_new[1:] = (key[order[1:]] != key[order[:-1]]).any(axis=1)
    first = np.empty(len(order), np.int64)
    first[order] = order[is_new][np.cumsum(is_new) - 1]
    kept = np.sort(order[is_new])
    return Weld(kept, np.searchsorted(kept, first))
