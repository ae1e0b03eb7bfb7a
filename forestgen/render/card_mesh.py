"""The mesh of a tree's cards: flat pieces over one texture, the side away from the crown's middle in front."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.limbs import unit
from forestgen.tree.model import Mesh

Piece = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]  # points (P, 3), uv (P, 2), faces (F, 3)


def card_pieces(
    box: NDArray[np.float64],
    axes: NDArray[np.float64],
    cell: NDArray[np.int64],
    scale: float,
    side: int,
) -> Piece:
    """Two triangles a card, as large as its cell (C, 4) px, about the middle of its box (C, 2, 3) along its axes."""
    unit_square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    half = (unit_square - 0.5)[None] * cell[:, None, 2:] / scale
    middle = box.mean(axis=1)
    flat = np.concatenate([middle[:, None, :2] + half, np.repeat(middle[:, None, 2:], 4, axis=1)], axis=2)
    points = np.einsum("cka,cai->cki", flat, axes).reshape(-1, 3)
    px = cell[:, None, :2] + cell[:, None, 2:] * [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]
    uv = (px / side * [1, -1] + [0, 1]).reshape(-1, 2)
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(len(box))[:, None, None]
    return points, uv, faces.reshape(-1, 3)


def outward_mesh(*pieces: Piece) -> Mesh:
    """Pieces, each flat, as one mesh; its normals stand between their own and the crown's, as if it were a ball."""
    offset = np.cumsum([0, *(len(points) for points, _, _ in pieces)])
    points, uv = (np.concatenate([piece[k] for piece in pieces]) for k in (0, 1))
    faces = np.concatenate([piece[2] + start for piece, start in zip(pieces, offset[:-1].tolist(), strict=True)])
    if not len(faces):
        return Mesh(points, points, uv, faces)
    outward = points - (points.min(axis=0) + points.max(axis=0)) / 2
    corner = points[faces]
    ahead = unit(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]))
    is_behind = np.einsum("fi,fi->f", outward[faces].mean(axis=1), ahead) < 0
    faces = np.where(is_behind[:, None], faces[:, ::-1], faces)
    facing = np.zeros_like(points)
    facing[faces] = np.where(is_behind[:, None], -ahead, ahead)[:, None]
    return Mesh(points, unit(unit(outward) + facing), uv, faces)
