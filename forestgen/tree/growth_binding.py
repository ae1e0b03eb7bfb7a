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
from forestgen.tree.growth_kernels import bind_to_ways, way_misfit
from forestgen.tree.skeleton import Skeleton

CANDIDATES = 12  # nodes about a limb's end among which the one is sought that it ends at
PROBES = 12  # vertices of a limb at which it is asked whether it runs along a way


def bind_mesh(points: NDArray[np.float64], faces: NDArray[np.int64], skeleton: Skeleton) -> Anchors:
    """Bind the vertices (P, 3) of a branch mesh with faces (F, 3).

    Each connected part of the mesh is a limb, its vertices in order from base to tip. It belongs to
    the way from the root to the node that it ends at: of the nodes about its last vertex the one
    whose way passes nearest to all of the limb, so that twigs which cross are not mistaken.
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
    misfit = way_misfit(skeleton.position, skeleton.parent, candidate, points[probe])
    end = candidate[np.arange(len(tip)), np.argmin(misfit, axis=1)]
    return _anchors(points, end[limb], skeleton)


def bind_leaves(foot: NDArray[np.float64], skeleton: Skeleton) -> Anchors:
    """Bind the feet (L, 3) of leaves' stalks to the nearest wood."""
    k = min(4, len(skeleton))
    near = cKDTree(skeleton.position).query(foot, k=k)[1].reshape(len(foot), k)
    misfit = way_misfit(skeleton.position, skeleton.parent, near, foot[:, None])
    return _anchors(foot, near[np.arange(len(foot)), np.argmin(misfit, axis=1)], skeleton)


def limbs_of(n_points: int, faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The connected part (P,) of a mesh that each vertex is in, numbered from 0 without gaps."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    link = coo_array((np.ones(len(ends), bool), (ends[:, 0], ends[:, 1])), shape=(n_points, n_points))
    return np.asarray(connected_components(link, directed=False)[1], np.int64)


def _anchors(points: NDArray[np.float64], end: NDArray[np.int64], skeleton: Skeleton) -> Anchors:
    """Bind points (V, 3) to the nearest places on the ways from the root to nodes (V,)."""
    position, parent = skeleton.position, skeleton.parent
    node, part = bind_to_ways(position, parent, end, points)
    base = position[np.maximum(parent[node], 0)]
    return Anchors(node, part, points - (base + part[:, None] * (position[node] - base)))
