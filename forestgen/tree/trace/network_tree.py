"""Network tree: a rooted tree through the wood network, by shortest ways that dislike turning.

A way runs from the root outward, piece by piece. Its price is its length, plus what it turns at
each junction, plus what it gains in thickness: so at a crossing each branch goes straight on, and
both arms of a fork leave in the direction of growth. Where leaves hide the wood, a link jumps from
the tree to a free end of a piece beyond, along a smooth curve that must not cross open background.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from heapq import heappop, heappush

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.trace.gap_links import FreeEnds, LinkRules, best_links, free_ends, link_course
from forestgen.tree.trace.half_width import at_points
from forestgen.tree.trace.wood_network import WoodNetwork


@dataclass(frozen=True, kw_only=True)
class WayPrices:
    """What a way costs, in pixels of plain wood."""

    turn_px: float  # a turn by 90 degrees
    view_px: float  # directions are seen over this length
    on_stroke: float  # a pixel under a stroke
    links: LinkRules


@dataclass(eq=False)
class PixelTree:
    """The tree while it grows, a node a pixel; `finish` gives arrays."""

    xy: list[tuple[float, float]] = field(default_factory=list)
    parent: list[int] = field(default_factory=list)
    is_hidden: list[bool] = field(default_factory=list)  # a link: the wood is not seen here

    def extend(self, points: NDArray[np.float64], parent: int, is_hidden: bool) -> int:
        """Append a run of points (K, 2) px behind a node; return the last one's index."""
        first = len(self.xy)
        self.xy += [(float(x), float(y)) for x, y in points]
        self.parent += [parent, *range(first, first + len(points) - 1)] if len(points) else []
        self.is_hidden += [is_hidden] * len(points)
        return len(self.xy) - 1 if len(points) else parent

    def arriving(self, node: int, view_px: float) -> NDArray[np.float64]:
        """Direction (2,) in which the tree arrives at a node, seen over `view_px`; zero at the root."""
        x, y = self.xy[node]
        back = node
        while self.parent[back] >= 0:
            back = self.parent[back]
            if (self.xy[back][0] - x) ** 2 + (self.xy[back][1] - y) ** 2 >= view_px**2:
                break
        return np.array([x - self.xy[back][0], y - self.xy[back][1]])


def span(
    network: WoodNetwork,
    trunk: NDArray[np.float64],
    entries: list[tuple[int, int]],
    *,
    distance: NDArray[np.float32],
    is_stroke: NDArray[np.bool_],
    is_covered: NDArray[np.bool_],
    prices: WayPrices,
) -> PixelTree:
    """The tree from the start of a trunk stroke (K, 2) px, entering the network at `entries`: (piece, which end).

    Each piece is entered once, from its cheaper end. A piece that only closes a ring is left out.
    `distance` (H, W) to the wood's edge, `is_stroke` under a stroke, `is_covered` leaf or wood.
    """
    tree = PixelTree()
    tree.extend(trunk[:1], -1, False)
    price = [_piece_price(points, is_stroke, prices.on_stroke) for points in network.points]
    width = [float(np.median(at_points(distance, points))) for points in network.points]
    free = free_ends(network, trunk, prices.view_px, prices.links.least_piece_px)
    queue: list[tuple[float, int, int, int, int, NDArray[np.float64] | None]] = [
        (0.0, i, *entry, 0, None) for i, entry in enumerate(entries)
    ]
    entered = np.zeros(len(network), bool)
    passed = np.zeros(len(network.pieces_at), bool)
    found = np.zeros(int(network.component.max()) + 1, bool)
    last_node: dict[int, int] = {}
    closes: dict[int, int] = {}  # piece that ends at a junction passed before -> node it left from
    pushed = len(entries)
    while queue:
        cost, _, piece, side, foot, link = heappop(queue)
        if entered[piece] or (link is not None and found[network.component[piece]]):
            continue
        entered[piece] = found[network.component[piece]] = True
        points = network.points[piece][:: 1 if side == 0 else -1]
        behind = len(tree.xy)
        if link is not None:
            target = network.points[piece][0 if side == 0 else -1]
            into = free.inward[free.index[piece, side]]
            foot = tree.extend(link_course(np.array(tree.xy[foot]), target, link, into), foot, True)
        first = len(tree.xy)
        node = last_node[piece] = tree.extend(points, foot, False)
        cost += price[piece]
        exit_junction = network.ends[piece][1 - side]
        if exit_junction >= 0:
            arriving = tree.arriving(node, max(prices.view_px, 5 * width[piece]))
            if passed[exit_junction]:
                closes[piece] = first
            passed[exit_junction] = True
            for onward, entry in network.pieces_at[exit_junction]:
                if not entered[onward]:
                    turning = _turn_price(network, onward, entry, arriving, distance, prices)
                    wider = max(0.0, np.log(max(width[onward], 1.5) / max(width[piece], 1.5)) - 0.3)
                    pushed += 1
                    onward_cost = cost + turning + prices.turn_px * wider
                    heappush(queue, (onward_cost, pushed, onward, entry, node, None))
        for link_cost, end, at, heading in _links(tree, behind, node, free, found, is_covered, prices):
            pushed += 1
            heappush(queue, (cost + link_cost, pushed, free.piece[end], free.side[end], at, heading))
    return without_rings(tree, closes, last_node)


def _links(
    tree: PixelTree,
    first: int,
    last: int,
    ends: FreeEnds,
    found: NDArray[np.bool_],
    is_covered: NDArray[np.bool_],
    prices: WayPrices,
) -> list[tuple[float, int, int, NDArray[np.float64]]]:
    """Links from a piece just entered to the free ends of parts not yet found: (price, end, node, direction)."""
    wanted = np.flatnonzero(~found[ends.component]) if len(ends.piece) else np.empty(0, np.int64)
    if not len(wanted):
        return []
    every = max(1, int(prices.links.every_px))
    nodes = np.array([*range(last, first, -every)] or [last])
    places = np.array([tree.xy[node] for node in nodes])
    directions = np.array([tree.arriving(int(node), prices.view_px) for node in nodes])
    chosen = best_links(places, directions, ends, wanted, is_covered, prices.links, prices.turn_px)
    return [(cost, end, int(nodes[place]), heading) for cost, end, place, heading in chosen]


def _piece_price(points: NDArray[np.float64], is_stroke: NDArray[np.bool_], on_stroke: float) -> float:
    column, row = points.astype(np.int64).T
    return float(np.where(is_stroke[row, column], on_stroke, 1.0).sum())


def turn_measure(cosine: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """How bad a turn is: 0 straight on, 0.09 at 45 degrees, 1 at 90, 4 for turning back."""
    return (1 - np.asarray(cosine)) ** 2


def _turn_price(
    network: WoodNetwork,
    piece: int,
    side: int,
    arriving: NDArray[np.float64],
    distance: NDArray[np.float32],
    prices: WayPrices,
) -> float:
    """Price of turning into a piece. Within the width of the wood it leaves, its line says nothing."""
    points = network.points[piece][:: 1 if side == 0 else -1]
    column, row = points[0].astype(int)
    start = min(int(distance[row, column]), max(0, len(points) - 3))
    view = max(prices.view_px, 3 * float(distance[row, column]))
    end = min(start + int(view), len(points) - 1)
    leaving = points[end] - points[start]
    size = float(np.hypot(*leaving) * np.hypot(*arriving))
    if size == 0:
        return 0.0
    trust = min(1.0, (end - start) / view)  # the next piece is compared over this one's whole length
    return float(prices.turn_px * trust * turn_measure(leaving @ arriving / size))


def without_rings(tree: PixelTree, closes: dict[int, int], last_node: dict[int, int]) -> PixelTree:
    """The tree without pieces that end where another already was, and from which nothing goes on."""
    parent = np.array(tree.parent)
    drop = np.zeros(len(parent), bool)
    n_children = np.bincount(parent[1:], minlength=len(parent)).tolist()
    for piece, first in closes.items():
        node = last_node[piece]
        while node >= first and n_children[node] == 0:  # back to where something branches off midway
            drop[node] = True
            n_children[tree.parent[node]] -= 1
            node = tree.parent[node]
    keep = ~drop
    place = np.cumsum(keep) - 1
    kept = np.flatnonzero(keep)
    return PixelTree(
        xy=[tree.xy[node] for node in kept],
        parent=[-1 if parent[node] < 0 else int(place[parent[node]]) for node in kept],
        is_hidden=[tree.is_hidden[node] for node in kept],
    )
