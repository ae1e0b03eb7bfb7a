"""Chiselling and smoothing a traced graph: stubs fall, ways run smoothly, needless nodes go (Neubert 2007, fig. 5c)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.lift.flow_tracing import Graph, norm
from forestgen.tree.skeleton import height_above_tips, main_child, n_children, path_length, tips_beyond

DETOUR = 0.6  # a way that is as the crow flies less than that of its length is cut short
BACKWARD = -0.2  # least cosine between a branch and what bears it, at their joint
PULL = 0.5  # of the way to the middle of its neighbours that a node goes in one round


def straightened(graph: Graph, window: float) -> Graph:
    """Lay loops and detours of a branch straight: what winds within `window` metres of way; longest detours first.

    Only ways of particles are moved, and what branches off is drawn along by the smoothing.
    """
    position, parent = graph.position.copy(), graph.parent
    onward = main_child(tips_beyond(parent).astype(float), parent)
    step = norm(position - position[np.maximum(parent, 0)])
    goes_on = (parent >= 0) & (onward[parent] == np.arange(len(parent))) & (graph.limb < 0)
    goes_on[1:] &= graph.limb[parent[1:]] < 0
    start = np.flatnonzero(goes_on)
    way, arc, back, gain = parent[start], step[start], np.zeros(len(start), np.int64), np.zeros(len(start))
    for count in range(2, len(parent)):
        going = goes_on[way] & (arc < window)
        if not going.any():
            break
        arc = np.where(going, arc + step[way], arc)
        way = np.where(going, parent[way], way)
        saved = arc - norm(position[start] - position[way])
        better = going & (saved > np.maximum(gain, (1 - DETOUR) * arc))
        back[better], gain[better] = count, saved[better]
    is_laid = np.zeros(len(parent), bool)
    for which in np.argsort(-gain, kind="stable")[: int((gain > 0).sum())]:
        inside = [int(start[which])]
        for _ in range(back[which]):
            inside.append(int(parent[inside[-1]]))
        if not is_laid[inside].any():
            share = np.linspace(0, 1, len(inside))[:, None]
            position[inside] = position[inside[0]] + share * (position[inside[-1]] - position[inside[0]])
            is_laid[inside] = True
    return Graph(position, parent, graph.limb)


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


def joined_forward(graph: Graph, farthest: float) -> Graph:
    """Move the joints of branches that bend back towards the root, until they lean outward; at most `farthest` metres.

    A branch that finds no such joint stays where it is.
    """
    position, parent = graph.position, graph.parent.copy()
    onward = main_child(tips_beyond(parent).astype(float), parent)
    side = np.flatnonzero((parent > 0) & (graph.limb < 0) & (onward[parent] != np.arange(len(parent))))
    way, moved = parent[side], np.zeros(len(side))
    for _ in range(len(parent)):
        out, axis = position[side] - position[way], position[way] - position[graph.parent[way]]
        good = np.sum(out * axis, axis=1) >= BACKWARD * norm(out) * norm(axis)
        parent[side[good]] = way[good]
        going = ~good & (moved < farthest)
        side, way, moved = side[going], way[going], moved[going] + norm(axis[going])
        side, way, moved = side[graph.parent[way] > 0], way[graph.parent[way] > 0], moved[graph.parent[way] > 0]
        way = graph.parent[way]
        if not len(side):
            break
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
