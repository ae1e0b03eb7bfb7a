"""Branch paths: a graph cut into branches, each a way from the fork where it leaves to a tip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.skeleton import branch_order, height_above_tips, main_child


@dataclass(frozen=True, eq=False)
class BranchPaths:
    """B branches of a graph; branch 0 is the trunk and begins at the root."""

    nodes: tuple[NDArray[np.int64], ...]  # of each branch, from its base outward; the base itself only in the trunk
    base: NDArray[np.int64]  # (B,) the node it leaves from; the root for the trunk
    parent: NDArray[np.int64]  # (B,) the branch it leaves, -1 for the trunk
    length: NDArray[np.float64]  # (B,) from base to tip
    axis: NDArray[np.float64]  # (B, 2) unit direction of the parent branch where it leaves
    order: NDArray[np.int64]  # (B,) all branches: parents first, then the longest first


def cut_into_paths(flat: NDArray[np.float64], parent: NDArray[np.int64]) -> BranchPaths:
    """Cut a graph with nodes at flat (N, 2): at a fork, the child that is long and straight on continues."""
    reach = height_above_tips(flat, parent)
    direction = smooth_direction(flat, parent)
    straight = np.ones(len(parent))
    straight[1:] = (direction[1:] * direction[parent[1:]]).sum(axis=1)
    continues = main_child(reach * (1.5 + straight), parent)
    starts = np.ones(len(parent), bool)
    starts[1:] = continues[parent[1:]] != np.arange(1, len(parent))
    branch = np.cumsum(starts) - 1
    for node in range(1, len(parent)):
        if not starts[node]:
            branch[node] = branch[parent[node]]
    first = np.flatnonzero(starts)
    base = np.maximum(parent[first], 0)
    sorted_nodes = np.argsort(branch, kind="stable")
    nodes = np.split(sorted_nodes, np.searchsorted(branch[sorted_nodes], np.arange(1, len(first))))
    step = np.hypot(*(flat - flat[np.maximum(parent, 0)]).T)
    length = np.bincount(branch, weights=step, minlength=len(first))
    generation = branch_order(parent, continues)[first]
    axis = direction[base]
    return BranchPaths(
        nodes=tuple(nodes),
        base=base,
        parent=np.concatenate([[-1], branch[base[1:]]]),
        length=np.maximum(length, 1e-9),
        axis=axis,
        order=np.lexsort((-length, generation)),
    )


def smooth_direction(flat: NDArray[np.float64], parent: NDArray[np.int64]) -> NDArray[np.float64]:
    """Unit directions (N, 2) in which the graph arrives at each node, seen over the last few edges."""
    arrive = flat - flat[np.maximum(parent, 0)]
    for node in range(1, len(parent)):
        above = parent[node]
        if above:
            arrive[node] += 0.6 * arrive[above]
    if len(parent) > 1:
        arrive[0] = arrive[1]
    return np.asarray(arrive / np.maximum(np.hypot(*arrive.T), 1e-12)[:, None])
