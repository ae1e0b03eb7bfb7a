"""Where instances stand: leaves on a tree by the prototype they wear, trees in a scene, and leaves on those."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.scene.forest import Forest
from forestgen.tree.model import Leaves
from forestgen.tree.places import place_matrices, rotation_matrix


@dataclass(frozen=True, eq=False)
class Places:
    """K places: scaled, then turned, then moved."""

    position: NDArray[np.float64]  # (K, 3) m
    turn: NDArray[np.float64]  # (K, 4) unit quaternion, i j k real
    size: NDArray[np.float64]  # (K,)

    def __post_init__(self) -> None:
        freeze(self, position=(np.float64, "K", 3), turn=(np.float64, "K", 4), size=(np.float64, "K"))

    def __len__(self) -> int:
        return len(self.size)

    def matrix(self) -> NDArray[np.float64]:
        """The places as matrices (K, 4, 4) for column vectors."""
        return place_matrices(self.position, self.turn, self.size)

    def of(self, inner: Places) -> Places:
        """Each of the inner places (I of them) within each of these: K * I places."""
        turned = np.einsum("kij,lj->kli", rotation_matrix(self.turn), inner.position)
        position = self.position[:, None] + self.size[:, None, None] * turned
        turn = hamilton(self.turn[:, None], inner.turn[None])
        size = self.size[:, None] * inner.size
        return Places(position.reshape(-1, 3), turn.reshape(-1, 4), size.ravel())


def hamilton(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The quaternion (..., 4) i j k real that turns by b, then by a."""
    vector = a[..., 3:] * b[..., :3] + b[..., 3:] * a[..., :3] + np.cross(a[..., :3], b[..., :3])
    real = a[..., 3:] * b[..., 3:] - np.sum(a[..., :3] * b[..., :3], axis=-1, keepdims=True)
    return np.concatenate([vector, real], axis=-1)


def leaf_places(leaves: Leaves, n_prototypes: int) -> list[Places]:
    """For each prototype the places of the leaves that wear it, in their order."""
    order = np.argsort(leaves.prototype, kind="stable")
    first = np.searchsorted(leaves.prototype[order], np.arange(n_prototypes + 1))
    turn = leaves.orientation[:, [1, 2, 3, 0]]
    return [Places(leaves.position[k], turn[k], leaves.size[k]) for k in (order[a:b] for a, b in pairwise(first))]


def standing_places(forest: Forest) -> list[Places]:
    """For each prototype of a forest the places of its trees, in their order."""
    half = forest.yaw / 2
    turn = np.stack([0 * half, np.sin(half), 0 * half, np.cos(half)], axis=1)
    which = [forest.prototype == k for k in range(len(forest.prototypes))]
    return [Places(forest.position[k], turn[k], forest.scale[k]) for k in which]
