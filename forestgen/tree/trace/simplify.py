"""Simplify a traced graph: joints that neither fork nor turn are dropped."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.branches import BranchGraph
from forestgen.tree.skeleton import n_children


def simplify(graph: BranchGraph, least_turn: float) -> BranchGraph:
    """Drop every joint that is no fork and turns by less than `least_turn` radians (Tan 2008, sec. 2).

    From the root outward: the direction into a joint starts from the last joint that was kept, so
    a slow bend keeps a joint each time its turns have added up. Root, forks and tips stay.
    """
    fork = n_children(graph.parent) != 1
    only = np.full(len(graph), -1)
    only[graph.parent[1:]] = np.arange(1, len(graph))  # read only where there is one child
    anchor = np.zeros(len(graph), np.int64)  # last kept joint at or before each node
    keep = fork.copy()
    keep[0] = True
    for node in range(1, len(graph)):
        above = graph.parent[node]
        anchor[node] = above if keep[above] else anchor[above]
        if not keep[node]:
            here = graph.xy[node]
            keep[node] = turn(here - graph.xy[anchor[node]], graph.xy[only[node]] - here) >= least_turn
    kept = np.flatnonzero(keep)
    place = np.cumsum(keep) - 1
    parent = np.where(kept == 0, -1, place[anchor[kept]])
    return BranchGraph(graph.xy[kept], parent, graph.radius_px[kept])


def turn(before: NDArray[np.float64], after: NDArray[np.float64]) -> float:
    """Angle between two directions (2,), radians in [0, pi]; 0 where one has no length."""
    return float(abs(np.arctan2(before[0] * after[1] - before[1] * after[0], before @ after)))
