"""Where a tree's leaves stand, by the prototype they wear: for instances, and for readers that know none."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from forestgen.render.drawable import Drawable
from forestgen.tree.model import LeafPrototype, Leaves, Mesh
from forestgen.usd.flatten import flattened, joined
from forestgen.usd.geometry import rotation_matrix


def by_prototype(leaves: Leaves, n_prototypes: int) -> list[NDArray[np.int64]]:
    """For each prototype the leaves that wear it, in their order."""
    order = np.argsort(leaves.prototype, kind="stable")
    first = np.searchsorted(leaves.prototype[order], np.arange(n_prototypes + 1))
    return [order[a:b] for a, b in pairwise(first)]


def leaf_drawables(leaves: Leaves, prototypes: Sequence[LeafPrototype]) -> list[Drawable]:
    """Each prototype with all places (K, 4, 4) of its leaves; K may be 0."""
    found = []
    for k, (leaf, chosen) in enumerate(zip(prototypes, by_prototype(leaves, len(prototypes)), strict=True)):
        place = np.tile(np.eye(4), (len(chosen), 1, 1))
        turn = rotation_matrix(leaves.orientation[chosen][:, [1, 2, 3, 0]])
        place[:, :3, :3] = turn * leaves.size[chosen, None, None]
        place[:, :3, 3] = leaves.position[chosen]
        found.append(
            Drawable(
                name=f"leaf_{k:02d}",
                points=leaf.points,
                faces=leaf.faces,
                uv=leaf.uv,
                normals=leaf.normals,
                is_leaf=True,
                transforms=place,
            )
        )
    return found


def flat_leaves(leaves: Leaves, prototypes: Sequence[LeafPrototype]) -> Mesh:
    """All leaves as one mesh, those of one prototype after another.

    Raises:
        ValueError: there is no prototype.
    """
    return joined([flattened(drawable) for drawable in leaf_drawables(leaves, prototypes)])
