"""Leaves that stay solid beside a tree's cards: flat strips, those of one prototype over one cell of the texture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.render.card_mesh import Piece
from forestgen.render.drawable import Drawable
from forestgen.tree.lod_prototypes import simpler
from forestgen.tree.model import LeafPrototype, TreeModel
from forestgen.tree.places import leaf_matrices

FINER = 2.0  # texels of a strip's cell for one of a card's, both ways
LEAST = 8  # px of a cell


@dataclass(frozen=True, eq=False)
class LeafStrips:
    """A solid leaves of B prototypes."""

    strip: tuple[LeafPrototype, ...]  # (B,) of two triangles each
    size: NDArray[np.float64]  # (B, 2) m, width and height of a leaf of middling size
    place: NDArray[np.float64]  # (A, 4, 4) from leaf space to the tree's
    which: NDArray[np.int64]  # (A,) into strip

    def __post_init__(self) -> None:
        freeze(self, size=(np.float64, "B", 2), place=(np.float64, "A", 4, 4), which=(np.int64, "A"))


def leaf_strips(model: TreeModel, leaf: NDArray[np.int64]) -> LeafStrips:
    """Strips in the places of some of a tree's leaves (A,)."""
    used, which = np.unique(model.leaves.prototype[leaf], return_inverse=True)
    strips = tuple(simpler(model.atlas.prototypes[k], 2) for k in used.tolist())
    size = np.array([np.ptp(strip.points[:, :2], axis=0) for strip in strips]).reshape(-1, 2)
    middling = float(np.median(model.leaves.size[leaf])) if len(leaf) else 1.0
    return LeafStrips(strips, size * middling, leaf_matrices(model.leaves)[leaf], which)


def strip_pieces(strips: LeafStrips, cell: NDArray[np.int64], side: int) -> Piece:
    """The strips in their places, over their cells (B, 4) px of a texture of `side` px."""
    points, uv, faces = [np.zeros((0, 3))], [np.zeros((0, 2))], [np.zeros((0, 3), np.int64)]
    n = 0
    for k, strip in enumerate(strips.strip):
        place = strips.place[strips.which == k]
        at = strip.points @ place[:, :3, :3].swapaxes(1, 2) + place[:, None, :3, 3]
        points.append(at.reshape(-1, 3))
        uv.append(np.tile(_in_cell(strip, cell[k]) / side * [1, -1] + [0, 1], (len(at), 1)))
        faces.append((n + len(strip.points) * np.arange(len(at))[:, None, None] + strip.faces).reshape(-1, 3))
        n += len(points[-1])
    return np.concatenate(points), np.concatenate(uv), np.concatenate(faces)


def strip_drawables(strips: LeafStrips, cell: NDArray[np.int64], side: int, rgba: NDArray[np.uint8]) -> list[Drawable]:
    """Each prototype's strip laid flat over its cell (B, 4) px, in px of the texture, y up."""
    found = []
    for k, strip in enumerate(strips.strip):
        px = _in_cell(strip, cell[k])
        flat = np.column_stack([px[:, 0], side - px[:, 1], np.zeros(len(px))])
        normals = np.broadcast_to([0.0, 0.0, 1.0], flat.shape)
        found.append(
            Drawable(
                name=f"strip_{k}",
                points=flat,
                faces=strip.faces,
                uv=strip.uv,
                normals=normals,
                texture=rgba,
                is_leaf=True,
            )
        )
    return found


def _in_cell(strip: LeafPrototype, cell: NDArray[np.int64]) -> NDArray[np.float64]:
    """Where a strip's points (V, 2) lie in its cell, px, x right and y down."""
    low, high = strip.uv.min(axis=0), strip.uv.max(axis=0)
    share = (strip.uv - low) / np.maximum(high - low, 1e-12)
    return np.asarray(cell[:2] + cell[2:] * np.column_stack([share[:, 0], 1 - share[:, 1]]))
