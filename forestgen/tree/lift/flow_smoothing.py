"""Chiselling and smoothing a traced graph: stubs fall, ways run smoothly, needless nodes go (Neubert 2007, fig. 5c)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.lift.flow_tracing import Graph
from forestgen.tree.skeleton import height_above_tips, main_child, n_children, path_length

PULL = 0.5  # of the way to the middle of its neighbours that a node goes in one round


def without_stubs(graph: Graph, shortest: float) -> Graph:
    """Drop branches shorter than `shortest` metres that particles left; a branch goes on into its longest child."""
    position, parent = graph.position, graph.parent
    reach = height_above_tips(position, parent)
    step = np.zeros(len(parent))
    step[1:] = np.linalg.norm(position[1:] - position[parent[1:]], axis=1)
    continues = main_child(np.where(graph.limb >= 0, np.inf, reach + step), parent)
    begins = np.ones(len(parent), bool)
    begins[1:] = continues[parent[1:]] != np.arange(1, len(parent))
    keep = (graph.limb >= 0) | ~begins | (reach + step >= shortest)
    for node in range(1, len(parent)):
        keep[node] &= keep[parent[node]]
    return kept(graph, keep)


def smoothed(graph: Graph, rounds: int) -> Graph:
    """Draw every node that a particle left towards the middle of its neighbours, `rounds` times.

    Its neighbours are its parent and the child with most tips beyond. Tips and visible limbs stay.
    """
    parent = graph.parent
    onward = main_child(tips_beyond(parent).astype(float), parent)
    node = np.flatnonzero((graph.limb < 0) & (onward >= 0) & (parent >= 0))
    position = graph.position.copy()
    for _ in range(rounds):
        middle = 0.5 * (position[parent[node]] + position[onward[node]])
        position[node] += PULL * (middle - position[node])
    return Graph(position, parent, graph.limb)


def thinned(graph: Graph, spacing: float) -> Graph:
    """Keep the root, forks, tips, and of the other nodes about one in every `spacing` metres of way."""
    along = path_length(graph.position, graph.parent)
    mark = np.floor(along / spacing)
    keep = n_children(graph.parent) != 1
    keep[0] = True
    keep[1:] |= mark[1:] > mark[graph.parent[1:]]
    return kept(graph, keep)


def kept(graph: Graph, keep: NDArray[np.bool_]) -> Graph:
    """The graph of some of its nodes (N,), the root among them; a node's parent is the nearest one kept before it."""
    above = graph.parent.copy()
    for node in range(1, len(above)):
        if not keep[above[node]]:
            above[node] = above[above[node]]
    rank = np.cumsum(keep) - 1
    parent = np.where(above >= 0, rank[above], -1)
    return Graph(graph.position[keep], parent[keep], graph.limb[keep])


def tips_beyond(parent: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number of tips beyond each node (N,), itself where it is one: how many particles were combined (sec. 8)."""
    count: NDArray[np.int64] = (n_children(parent) == 0).astype(np.int64)
    for node in range(len(parent) - 1, 0, -1):
        count[parent[node]] += count[node]
    return count
