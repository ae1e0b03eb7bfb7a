"""Draft: a rooted graph of pixels while it is being traced."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.branches import BranchGraph


class Draft:
    """Nodes are appended, and edges may be split; `finish` puts parents before their children."""

    def __init__(self, root: NDArray[np.float64]) -> None:
        self.xy: list[tuple[float, float]] = [(float(root[0]), float(root[1]))]
        self.parent: list[int] = [-1]

    def __len__(self) -> int:
        return len(self.xy)

    def add(self, point: NDArray[np.float64], parent: int) -> int:
        """Append a node at a point (2,) px and return its index."""
        self.xy.append((float(point[0]), float(point[1])))
        self.parent.append(parent)
        return len(self.xy) - 1

    def distance(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances (N,) px from a point to all nodes so far."""
        offset = np.array(self.xy) - point
        return np.hypot(offset[:, 0], offset[:, 1])

    def attach(self, point: NDArray[np.float64], snap_px: float) -> int:
        """The node at the graph's nearest place to a point (2,) px: an edge is split where no node is near."""
        xy, parent = np.array(self.xy), np.array(self.parent)
        if len(xy) == 1:
            return 0
        start, along = xy[parent[1:]], xy[1:] - xy[parent[1:]]
        share = np.clip(((point - start) * along).sum(1) / np.maximum((along**2).sum(1), 1e-12), 0, 1)
        foot = start + share[:, None] * along
        edge = int(np.argmin(np.hypot(*(foot - point).T)))
        near = self.distance(foot[edge])
        if near.min() <= snap_px:
            return int(np.argmin(near))
        split = self.add(foot[edge], self.parent[edge + 1])
        self.parent[edge + 1] = split
        return split

    def finish(self, radius_px: float) -> BranchGraph:
        """The graph breadth first; only the root's radius is known."""
        parent = np.array(self.parent)
        order = breadth_first(parent)
        place = np.empty(len(order), np.int64)
        place[order] = np.arange(len(order))
        radius = np.full(len(order), np.nan)
        radius[0] = radius_px
        above = np.where(parent[order] < 0, -1, place[parent[order]])
        return BranchGraph(np.array(self.xy)[order], above, radius)


def breadth_first(parent: NDArray[np.int64]) -> NDArray[np.int64]:
    """All nodes (N,) reachable from node 0, level by level."""
    order = np.argsort(parent, kind="stable")
    first = np.searchsorted(parent[order], np.arange(len(parent) + 1))
    level, levels = np.array([0]), [np.array([0])]
    while len(level):
        level = np.concatenate([order[first[node] : first[node + 1]] for node in level])
        levels.append(level)
    return np.concatenate(levels).astype(np.int64)
