"""Flattening: what stands in many places becomes one mesh, for readers that know no instances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forestgen.render.drawable import Drawable
from forestgen.tree.joined import joined
from forestgen.tree.model import LeafPrototype, Leaves, Mesh, vertex_normals
from forestgen.tree.places import leaf_matrices


def flattened(drawable: Drawable) -> Mesh:
    """A drawable's mesh once for each of its places, in the order of the places, as one mesh.

    K places of P points and F faces give K * P points and K * F faces. Normals turn as planes do; a place
    that mirrors gets its faces' corners in reverse, so that they still face outward.
    """
    points, faces, places = drawable.points, drawable.faces, drawable.transforms
    n_places, n_points = len(places), len(points)
    normals = vertex_normals(points, faces) if drawable.normals is None else drawable.normals
    uv = np.zeros((n_points, 2)) if drawable.uv is None else drawable.uv
    turn = places[:, :3, :3]
    moved = np.einsum("kij,pj->kpi", turn, points) + places[:, None, :3, 3]
    turned = np.einsum("kij,pj->kpi", cofactors(turn), normals)
    length = np.linalg.norm(turned, axis=2, keepdims=True)
    turned = np.where(length > 0, turned / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])
    index = faces[None] + n_points * np.arange(n_places)[:, None, None]
    is_mirrored = np.linalg.det(turn) < 0
    index[is_mirrored] = index[is_mirrored][:, :, ::-1]
    return Mesh(moved.reshape(-1, 3), turned.reshape(-1, 3), np.tile(uv, (n_places, 1)), index.reshape(-1, 3))


def flat_leaves(leaves: Leaves, prototypes: Sequence[LeafPrototype]) -> tuple[Mesh, NDArray[np.int64]]:
    """All leaves as one mesh, those of one prototype after another, and the leaf (P,) that each point is of.

    Raises:
        ValueError: there is no prototype.
    """
    matrix = leaf_matrices(leaves)
    meshes, owners = [], []
    for k, leaf in enumerate(prototypes):
        chosen = np.flatnonzero(leaves.prototype == k)
        shape = Drawable(
            name="leaf", points=leaf.points, faces=leaf.faces, uv=leaf.uv, normals=leaf.normals,
            transforms=matrix[chosen],
        )  # fmt: skip
        meshes.append(flattened(shape))
        owners.append(np.repeat(chosen, len(leaf.points)))
    return joined(meshes), np.concatenate(owners)


def cofactors(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """What turns normals where `matrix` (K, 3, 3) moves points: its inverse transposed, times |its determinant|.

    Needs no inverse, so that a place flattened to nothing still gives finite numbers.
    """
    a, b, c = np.moveaxis(matrix, -1, 0)  # columns (K, 3)
    turned = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-1)
    return np.where(np.linalg.det(matrix)[:, None, None] < 0, -turned, turned)
