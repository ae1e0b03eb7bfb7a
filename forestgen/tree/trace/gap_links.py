"""Gap links: smooth curves behind the leaves, from the tree to a piece of wood seen through a gap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.trace.wood_network import WoodNetwork

SHARPEST_FORK = np.cos(np.deg2rad(75.0))  # between the way of the tree and a link that leaves it
SHARPEST_BEND = np.cos(np.deg2rad(55.0))  # between a link and the wood that it leads to
CURVE = 14  # points at which a link's course is looked at


@dataclass(frozen=True, kw_only=True)
class LinkRules:
    """When a link is plausible and what it costs."""

    longest_px: float
    longest_share: float  # of the visible length beyond
    least_piece_px: float  # shorter visible parts are noise, not worth a link
    price: float  # of a hidden pixel in a short link; in the longest it counts double
    most_open: float  # share of the link that may lie before open background
    every_px: float  # places on the tree between which a link may leave


@dataclass(frozen=True, eq=False)
class FreeEnds:
    """E free ends of a network's pieces."""

    xy: NDArray[np.float64]  # (E, 2) px
    inward: NDArray[np.float64]  # (E, 2) unit direction from the end into its piece
    piece: list[int]
    side: list[int]
    component: NDArray[np.int64]  # (E,)
    beyond: NDArray[np.float64]  # (E,) px of wood seen in the part of the network behind the end
    homeward: NDArray[np.float64]  # (E,) in [0, 1]: entered here, the piece would grow towards the trunk
    index: dict[tuple[int, int], int]  # (piece, side) -> end


def free_ends(network: WoodNetwork, trunk: NDArray[np.float64], view_px: float, least_px: float) -> FreeEnds:
    """All free ends of parts of the network that are long enough to have a direction. `trunk` (K, 2) px."""
    total = np.bincount(network.component, weights=network.length).astype(np.float64)
    where = [(int(p), int(s)) for p, s in np.argwhere(network.ends < 0) if total[network.component[p]] >= least_px]
    xy, inward = np.zeros((len(where), 2)), np.zeros((len(where), 2))
    for index, (piece, side) in enumerate(where):
        points = network.points[piece][:: 1 if side == 0 else -1]
        into = points[min(int(view_px), len(points) - 1)] - points[0]
        xy[index], inward[index] = points[0], into / max(np.hypot(*into), 1e-9)
    apart = xy[:, None] - trunk
    outward = apart[np.arange(len(xy)), (apart**2).sum(axis=2).argmin(axis=1)]
    homeward = np.maximum(0, -(outward * inward).sum(axis=1)) / np.maximum(np.hypot(*outward.T), 1e-9)
    pieces = [piece for piece, _ in where]
    return FreeEnds(
        xy=xy,
        inward=inward,
        piece=pieces,
        side=[side for _, side in where],
        component=network.component[pieces].astype(np.int64),
        beyond=total[network.component[pieces].astype(np.int64)],
        homeward=homeward,
        index={key: end for end, key in enumerate(where)},
    )


def best_links(
    places: NDArray[np.float64],
    directions: NDArray[np.float64],
    ends: FreeEnds,
    wanted: NDArray[np.int64],
    is_covered: NDArray[np.bool_],
    rules: LinkRules,
    turn_px: float,
) -> list[tuple[float, int, int, NDArray[np.float64]]]:
    """The cheapest link to each wanted end that has one: (price, end, place, direction (2,) of leaving).

    Links leave places (S, 2) px of the tree, which arrives there in directions (S, 2).
    """
    across = ends.xy[wanted][None] - places[:, None]
    apart = np.hypot(across[..., 0], across[..., 1])
    way = across / np.maximum(apart, 1e-9)[..., None]
    heading = directions / np.maximum(np.hypot(*directions.T), 1e-9)[:, None]
    fork = (way * heading[:, None]).sum(axis=2)
    bend = (way * ends.inward[wanted][None]).sum(axis=2)
    longest = np.minimum(rules.longest_px, rules.longest_share * ends.beyond[wanted])
    place, end = np.nonzero((apart > 0) & (apart < longest) & (fork > SHARPEST_FORK) & (bend > SHARPEST_BEND))
    if not len(place):
        return []
    gap, heading = apart[place, end], heading[place]
    turning = (1 - fork[place, end]) ** 2 + 2 * (1 - bend[place, end]) ** 2 + ends.homeward[wanted[end]]
    price = rules.price * gap * (1 + gap / rules.longest_px) + turn_px * turning
    cheapest = np.lexsort((price, end))
    first = cheapest[np.r_[True, np.diff(end[cheapest]) > 0]]
    start, target = place[first], wanted[end[first]]  # only the cheapest of each end is looked at in the photo
    courses = hermite(places[start], ends.xy[target], heading[first], ends.inward[target], CURVE)
    column, row = np.clip(courses.astype(np.int64), 0, np.array(is_covered.shape[::-1]) - 1).T
    is_open = 1 - is_covered[row, column].mean(axis=0)
    cost = price[first] + 4 * rules.price * gap[first] * is_open
    fits = np.flatnonzero(is_open <= rules.most_open)
    return [(float(cost[i]), int(target[i]), int(start[i]), heading[first[i]]) for i in fits]


def hermite(
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    leaving: NDArray[np.float64],
    arriving: NDArray[np.float64],
    n: int,
) -> NDArray[np.float64]:
    """Points (L, n, 2) of L cubics from start to end (L, 2); they leave half in the given direction, half straight."""
    across = end - start
    gap = np.hypot(across[:, 0], across[:, 1])[:, None]
    straight = across / np.maximum(gap, 1e-9)
    t = np.linspace(0, 1, n)[:, None]
    out, into = (gap * (straight + leaving) / 2)[:, None], (gap * (straight + arriving) / 2)[:, None]
    return np.asarray(
        (2 * t**3 - 3 * t**2 + 1) * start[:, None]
        + (t**3 - 2 * t**2 + t) * out
        + (-2 * t**3 + 3 * t**2) * end[:, None]
        + (t**3 - t**2) * into
    )


def link_course(
    start: NDArray[np.float64], end: NDArray[np.float64], leaving: NDArray[np.float64], arriving: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Points (C, 2) between the ends of one link, about 2 px apart; none where the ends are neighbours."""
    n = max(2, int(np.hypot(*(end - start)) / 2))
    return hermite(start[None], end[None], leaving[None], arriving[None], n)[0, 1:-1]
