"""Branch paths: a flat graph cut into branches, each a way from the fork where it leaves to a tip."""

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

    def __len__(self) -> int:
        return len(self.parent)


def cut_into_paths(flat: NDArray[np.float64], parent: NDArray[np.int64], scale: float) -> BranchPaths:
    """Cut a graph with nodes at flat (N, 2): at a fork, the child that is long and goes straight on continues.

    Directions are seen over about the length `scale`, in the units of flat.
    """
    reach = height_above_tips(flat, parent)
    arriving = arriving_direction(flat, parent, scale)
    leaving = leaving_direction(flat, parent, reach, scale)
    above = np.maximum(parent, 0)
    straight = (arriving[above] * leaving).sum(axis=1)
    continues = main_child(reach * np.maximum(1.2 + straight, 0.05), parent)
    starts = np.ones(len(parent), bool)
    starts[1:] = continues[parent[1:]] != np.arange(1, len(parent))
    label = (np.cumsum(starts) - 1).tolist()
    for node, (begins, before) in enumerate(zip(starts.tolist(), parent.tolist(), strict=True)):
        if not begins:
            label[node] = label[before]
    branch = np.array(label)
    first = np.flatnonzero(starts)
    base = above[first]
    by_branch = np.argsort(branch, kind="stable")
    nodes = np.split(by_branch, np.searchsorted(branch[by_branch], np.arange(1, len(first))))
    step = np.hypot(*(flat - flat[above]).T)
    length = np.bincount(branch, weights=step, minlength=len(first))
    return BranchPaths(
        nodes=tuple(nodes),
        base=base,
        parent=np.concatenate([[-1], branch[base[1:]]]),
        length=np.maximum(length, 1e-9),
        axis=arriving[base],
        order=np.lexsort((-length, branch_order(parent, continues)[first])),
    )


def arriving_direction(flat: NDArray[np.float64], parent: NDArray[np.int64], scale: float) -> NDArray[np.float64]:
    """Unit directions (N, 2) in which the graph arrives at each node, older edges counting less and less."""
    step = flat - flat[np.maximum(parent, 0)]
    keep = np.exp(-np.hypot(*step.T) / scale).tolist()
    x, y = step[:, 0].tolist(), step[:, 1].tolist()
    for node, above in enumerate(parent.tolist()):
        if above > 0:
            x[node] += keep[node] * x[above]
            y[node] += keep[node] * y[above]
    if len(x) > 1:
        x[0], y[0] = x[1], y[1]
    return _unit(np.column_stack([x, y]))


def leaving_direction(
    flat: NDArray[np.float64], parent: NDArray[np.int64], reach: NDArray[np.float64], scale: float
) -> NDArray[np.float64]:
    """Unit directions (N, 2) in which the graph leaves for each node and goes on beyond it."""
    step = flat - flat[np.maximum(parent, 0)]
    onward = main_child(reach, parent).tolist()
    x, y = step[:, 0].tolist(), step[:, 1].tolist()
    keep = np.exp(-np.hypot(*step.T) / scale).tolist()
    for node in range(len(x) - 1, -1, -1):
        beyond = onward[node]
        if beyond >= 0:
            x[node] += keep[node] * x[beyond]
            y[node] += keep[node] * y[beyond]
    return _unit(np.column_stack([x, y]))


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vector / np.maximum(np.hypot(*vector.T), 1e-12)[:, None])
