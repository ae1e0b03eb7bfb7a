"""Densify: nodes put between those of a skeleton, on smooth curves, so that branches can start where they should."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow.axes import continuation
from forestgen.tree.skeleton import Skeleton

BOW = 0.2  # of the spacing: how far a curve may stray from the chord between two nodes


def densify(skeleton: Skeleton, spacing: float) -> tuple[Skeleton, NDArray[np.int64]]:
    """The skeleton with nodes at most about `spacing` metres apart, and where its nodes (N,) now are.

    The nodes keep their places, radii and order; those between them lie on the cubic through them
    (along a branch; where one starts it leaves straight), their radii on a line.
    """
    position, parent, radius = skeleton.position, skeleton.parent, skeleton.radius
    n = len(parent)
    step = np.zeros((n, 3))
    step[1:] = position[1:] - position[parent[1:]]
    length = np.linalg.norm(step, axis=1)
    continues = continuation(skeleton)
    tangent = _tangents(step, length, continues)
    carried = np.zeros(n, bool)
    carried[1:] = continues[parent[1:]] == np.arange(1, n)
    start = np.where((carried & (parent > 0))[:, None], tangent[parent], step / np.maximum(length, 1e-12)[:, None])

    pieces = np.maximum(1, np.ceil(length / spacing - 0.25).astype(np.int64))
    pieces[0] = 1
    index = np.cumsum(pieces) - 1  # of the old nodes among the new
    old = np.repeat(np.arange(n), pieces)  # the old node that each new one leads to
    rank = np.arange(len(old)) - (index[old] - pieces[old] + 1) + 1  # 1 .. pieces
    t = (rank / pieces[old])[:, None]
    a, b = position[np.maximum(parent[old], 0)], position[old]
    da, db = (_bowed(end, step, length, BOW * spacing)[old] for end in (start, tangent))
    s = 1 - t
    between = a * s * s * (1 + 2 * t) + da * t * s * s - db * t * t * s + b * t * t * (3 - 2 * t)
    is_old = rank == pieces[old]
    place = np.where(is_old[:, None], b, between)
    above = np.where(
        rank == 1, np.where(parent[old] < 0, -1, index[np.maximum(parent[old], 0)]), np.arange(len(old)) - 1
    )
    low = np.where(carried[old], radius[np.maximum(parent[old], 0)], radius[old])
    thick = np.where(is_old, radius[old], low * s[:, 0] + radius[old] * t[:, 0])
    return Skeleton(place, above, thick), index


def _bowed(
    direction: NDArray[np.float64], step: NDArray[np.float64], length: NDArray[np.float64], bow: float
) -> NDArray[np.float64]:
    """End derivatives (N, 3) of the cubics: shortened where the curve would stray farther than `bow` from its chord."""
    along = step / np.maximum(length, 1e-12)[:, None]
    across = direction - (direction * along).sum(axis=1, keepdims=True) * along
    strays = np.linalg.norm(across, axis=1) * length
    return np.asarray(direction * (length * np.minimum(1, 4 * bow / np.maximum(strays, 1e-12)))[:, None])


def _tangents(
    step: NDArray[np.float64], length: NDArray[np.float64], continues: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Unit directions (N, 3) of the branch at each node: of the parabola through it and its neighbours."""
    after = np.where(continues >= 0, continues, 0)
    ahead = np.where((continues >= 0)[:, None], step[after], step)
    far = np.where(continues >= 0, length[after], length)
    mixed = step * (far / np.maximum(length, 1e-12))[:, None] + ahead * (length / np.maximum(far, 1e-12))[:, None]
    mixed[0] = ahead[0]
    return np.asarray(mixed / np.maximum(np.linalg.norm(mixed, axis=1, keepdims=True), 1e-12))
