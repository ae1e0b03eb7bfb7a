"""LimbTree: a skeleton cut into the limbs that its mesh is made of, and what lies nearest to its wood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.arrays import freeze
from forestgen.tree.growth_kernels import nearest_piece
from forestgen.tree.limbs import Limbs, limbs_along, merge_coincident, thickest_child, without_hairpins
from forestgen.tree.skeleton import Skeleton

NEAR_NODES = 4  # nodes about a point among whose pieces of wood the nearest is sought


@dataclass(frozen=True, eq=False)
class LimbTree:
    """A skeleton without coincident nodes, cut into limbs."""

    skeleton: Skeleton
    limbs: Limbs
    limb_of_node: NDArray[np.int64]  # (N,)

    def __post_init__(self) -> None:
        freeze(self, limb_of_node=(np.int64, "N"))


def limb_tree(skeleton: Skeleton) -> LimbTree:
    """Cut a skeleton into the limbs that its mesh is made of. A root alone becomes a bud as tall as it is thick.

    Raises:
        ValueError: a radius is NaN or negative.
    """
    if not np.all(skeleton.radius >= 0):
        raise ValueError("limb_tree: a radius is NaN or negative; run the radius stage first")
    merged = merge_coincident(skeleton)
    if len(merged) == 1:
        bud = merged.position + np.array([0.0, max(float(merged.radius[0]), 1e-3), 0.0])
        merged = Skeleton(np.concatenate([merged.position, bud]), np.array([-1, 0]), merged.radius[[0, 0]])
    limbs = limbs_along(merged, without_hairpins(merged, thickest_child(merged)))
    limb = limbs.limb
    own = np.ones(len(limbs.node), bool)
    own[limbs.first[1:-1]] = False  # the base of a side limb is its parent's node
    of_node = np.empty(len(merged), np.int64)
    of_node[limbs.node[own]] = limb[own]
    return LimbTree(merged, limbs, of_node)


def nearest_unit(points: NDArray[np.float64], skeleton: Skeleton) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The node (P,) that ends the piece of wood nearest to points (P, 3), and the place along it (P,) in [0, 1].

    Sought among the pieces that end at the nearest nodes.
    """
    k = min(NEAR_NODES, len(skeleton))
    node = cKDTree(skeleton.position).query(points, k=k)[1].reshape(len(points), k)
    nearest, part = nearest_piece(skeleton.position, skeleton.parent, node, points)
    return nearest, part
