"""Binding: to which piece of a skeleton each vertex of a branch mesh, and each leaf, belongs.

Known from the finished geometry alone, so that it works on a written asset.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from forestgen.tree.growth import Anchors
from forestgen.tree.growth_kernels import bind_to_ways, nearest_way
from forestgen.tree.skeleton import Skeleton

CANDIDATES = 12  # nodes about a limb's end among which the one is sought that it ends at
MOST_SIDES = 40  # vertices around a limb, at most
SEAM = 2e-6  # share of the tree's size within which the vertices of a seam meet (stored as float32)
PROBES = 12  # vertices of a limb at which it is asked whether it runs along a way


def bind_mesh(points: NDArray[np.float64], faces: NDArray[np.int64], skeleton: Skeleton) -> Anchors:
    """Bind the vertices (P, 3) of a branch mesh with faces (F, 3).

    Each connected part of the mesh is a limb, its vertices in order from base to tip. It belongs to
    the way from the root to the node that it ends at: of the nodes about its last vertex the one
    whose way passes nearest to all of the limb, so that twigs which cross are not mistaken.

    Vertices of one ring are bound to one place: as long as wood has no thickness its triangles then
    have no area either, also where the axis bends.
    """
    limb = limbs_of(len(points), faces)
    order = np.argsort(limb, kind="stable")
    count = np.bincount(limb)
    first = np.concatenate([[0], np.cumsum(count)])
    tip = order[first[1:] - 1]
    k = min(CANDIDATES, len(skeleton))
    candidate = cKDTree(skeleton.position).query(points[tip], k=k)[1].reshape(len(tip), k)
    share = np.linspace(0, 1, PROBES)
    probe = order[(first[:-1, None] + np.round(share * (count[:, None] - 1)).astype(np.int64))]
    nearest = nearest_way(skeleton.position, skeleton.parent, candidate, points[probe])
    end = candidate[np.arange(len(tip)), nearest]
    ring = np.empty(len(points), np.int64)
    ring[order] = rings_of(points[order], first)
    n = np.bincount(ring)
    centre = np.stack([np.bincount(ring, points[:, k]) for k in range(3)], axis=1) / n[:, None]
    limb_of_ring = np.zeros(len(n), np.int64)
    limb_of_ring[ring] = limb
    node, part = bind_to_ways(skeleton.position, skeleton.parent, end[limb_of_ring], centre)
    return _anchors(points, node, part, ring, skeleton)


def rings_of(points: NDArray[np.float64], first: NDArray[np.int64]) -> NDArray[np.int64]:
    """The ring (P,) of each vertex (P, 3) of limbs bounded by `first` (L + 1,), numbered along the mesh.

    A limb is rings of equally many vertices, the last of which lies on the first (the texture's seam),
    and one vertex at its tip. Where a limb is something else each vertex is a ring of its own.
    """
    near = SEAM * float(np.ptp(points, axis=0).max())
    start, count = first[:-1], np.diff(first)
    size = np.ones(len(count), np.int64)
    for k in range(MOST_SIDES, 2, -1):
        other = np.minimum(start + k, len(points) - 1)
        meets = (count > k + 1) & (np.linalg.norm(points[other] - points[start], axis=1) <= near)
        size[meets & ((count - 1) % (k + 1) == 0)] = k + 1
    n_rings = -(-count // size)
    limb = np.repeat(np.arange(len(count)), count)
    rank = np.arange(len(points)) - start[limb]
    return np.asarray((np.cumsum(n_rings) - n_rings)[limb] + rank // size[limb])


def bind_leaves(foot: NDArray[np.float64], skeleton: Skeleton) -> Anchors:
    """Bind the feet (L, 3) of leaves' stalks to the nearest wood."""
    k = min(4, len(skeleton))
    near = cKDTree(skeleton.position).query(foot, k=k)[1].reshape(len(foot), k)
    end = near[np.arange(len(foot)), nearest_way(skeleton.position, skeleton.parent, near, foot[:, None])]
    node, part = bind_to_ways(skeleton.position, skeleton.parent, end, foot)
    return _anchors(foot, node, part, np.arange(len(foot)), skeleton)


def limbs_of(n_points: int, faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The connected part (P,) of a mesh that each vertex is in, numbered from 0 without gaps."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    link = coo_array((np.ones(len(ends), bool), (ends[:, 0], ends[:, 1])), shape=(n_points, n_points))
    return np.asarray(connected_components(link, directed=False)[1], np.int64)


def _anchors(
    points: NDArray[np.float64],
    node: NDArray[np.int64],
    part: NDArray[np.float64],
    ring: NDArray[np.int64],
    skeleton: Skeleton,
) -> Anchors:
    """Points (V, 3) bound to the places (R,) along nodes' (R,) units of their rings (V,)."""
    base = skeleton.position[np.maximum(skeleton.parent[node], 0)]
    axis = base + part[:, None] * (skeleton.position[node] - base)
    return Anchors(node[ring], part[ring], points - axis[ring])
