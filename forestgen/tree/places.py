"""Places: where things stand, from quaternions, positions and sizes to matrices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.model import Leaves


def rotation_matrix(turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrices (L, 3, 3) for column vectors, of quaternions (L, 4) i j k real.

    They are not made unit first: USD does not either, and halves are unit to 1e-3 only.
    """
    i, j, k, w = turn.T
    rows = [
        [1 - 2 * (j * j + k * k), 2 * (i * j - k * w), 2 * (i * k + j * w)],
        [2 * (i * j + k * w), 1 - 2 * (i * i + k * k), 2 * (j * k - i * w)],
        [2 * (i * k - j * w), 2 * (j * k + i * w), 1 - 2 * (i * i + j * j)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def place_matrices(
    position: NDArray[np.float64], turn: NDArray[np.float64], size: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Matrices (K, 4, 4) for column vectors: scaled by size (K,), then turned (K, 4) i j k real, then moved (K, 3)."""
    places = np.tile(np.eye(4), (len(size), 1, 1))
    places[:, :3, :3] = rotation_matrix(turn) * size[:, None, None]
    places[:, :3, 3] = position
    return places


def leaf_matrices(leaves: Leaves) -> NDArray[np.float64]:
    """From leaf space to the tree's (L, 4, 4), for column vectors."""
    return place_matrices(leaves.position, leaves.orientation[:, [1, 2, 3, 0]], leaves.size)
