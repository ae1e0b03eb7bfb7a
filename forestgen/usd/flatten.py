"""Flattening: what stands in many places becomes one mesh, for readers that know no instances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forestgen.render.drawable import Drawable
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


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Meshes one after the other as one mesh.

    Raises:
        ValueError: there is none.
    """
    if not meshes:
        raise ValueError("no mesh to join")
    first = np.cumsum([0] + [len(mesh.points) for mesh in meshes[:-1]])
    return Mesh(
        points=np.concatenate([mesh.points for mesh in meshes]),
        normals=np.concatenate([mesh.normals for mesh in meshes]),
        uv=np.concatenate([mesh.uv for mesh in meshes]),
        faces=np.concatenate([mesh.faces + start for mesh, start in zip(meshes, first, strict=True)]),
    )


def welded(mesh: Mesh) -> tuple[Mesh, NDArray[np.float64]]:
    """A mesh without points of the same place and normal, as float32, and the uv (3 F, 2) of its faces' corners.

    Points stand in the order of their first use; a seam of the texture is no longer one of the mesh.
    """
    row = np.concatenate([mesh.points, mesh.normals], axis=1).astype(np.float32) + np.float32(0)  # no -0
    key = np.ascontiguousarray(row).view(np.uint64)  # (P, 3)
    order = np.lexsort(key.T)
    is_new = np.ones(len(order), bool)
    is_new[1:] = (key[order[1:]] != key[order[:-1]]).any(axis=1)
    group = np.empty(len(order), np.int64)
    group[order] = np.cumsum(is_new) - 1
    first = np.full(int(is_new.sum()), len(order))
    np.minimum.at(first, group, np.arange(len(order)))
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    kept = np.sort(first)
    one = Mesh(mesh.points[kept], mesh.normals[kept], mesh.uv[kept], rank[group][mesh.faces])
    return one, mesh.uv[mesh.faces.ravel()]
