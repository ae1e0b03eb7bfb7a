"""Stroke routes: a roughly drawn stroke slides onto the wood beside it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from forestgen.tree.strokes import draw_polyline

OFF_WOOD = 6.0  # how much dearer a pixel beside the wood is than one in the middle of it
AWAY = 1.0  # how much dearer the corridor's edge is than the stroke itself


def route_stroke(path: NDArray[np.float64], distance: NDArray[np.float32], reach_px: float) -> NDArray[np.float64]:
    """The cheapest way (K, 2) px beside a stroke (P, 2): along wood where it is near, else along the stroke.

    `distance` (H, W) is each wood pixel's distance to the wood's edge, 0 off the wood; the way
    stays within `reach_px` of the stroke and keeps the stroke's ends.
    """
    size = (distance.shape[1], distance.shape[0])
    low = np.maximum(np.floor(path.min(axis=0) - reach_px - 2), 0).astype(int)
    high = np.minimum(np.ceil(path.max(axis=0) + reach_px + 2).astype(int), size)
    patch = distance[low[1] : high[1], low[0] : high[0]]
    drawn = draw_polyline(path - low, (patch.shape[1], patch.shape[0]))
    away = cv2.distanceTransform((~drawn).astype(np.uint8), cv2.DIST_L2, 5)
    inside = away <= reach_px
    widest = cv2.dilate(patch, np.ones((9, 9), np.uint8))  # the middle of a limb is as good as that of a twig
    price = np.where(patch > 0, 1 + 2 * (1 - patch / np.maximum(widest, 1e-6)), OFF_WOOD)
    price = price + AWAY * away / reach_px
    ends = np.clip(np.floor(path[[0, -1]] - low).astype(int), 0, np.array(patch.shape[::-1]) - 1)
    inside[ends[:, 1], ends[:, 0]] = True
    return np.asarray(cheapest_way(price, inside, ends[0], ends[1]) + low + 0.5)


def cheapest_way(
    price: NDArray[np.float64], inside: NDArray[np.bool_], start: NDArray[np.int64], end: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Pixels (K, 2) xy of the cheapest way between two pixels over a mask; diagonal steps cost sqrt(2)."""
    height, width = inside.shape
    number = np.full((height, width), -1)
    number[inside] = np.arange(inside.sum())
    start_node, end_node = number[start[1], start[0]], number[end[1], end[0]]
    rows, columns, costs = [], [], []
    for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = number[: height - dy, max(0, -dx) : width - max(0, dx)]
        there = number[dy:, max(0, dx) : width + min(0, dx)]
        both = (here >= 0) & (there >= 0)
        a, b = here[both], there[both]
        cost = (price[inside][a] + price[inside][b]) / 2 * np.hypot(dx, dy)
        rows += [a, b]
        columns += [b, a]
        costs += [cost, cost]
    n = int(inside.sum())
    graph = csr_array((np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n))
    _, before = dijkstra(graph, indices=start_node, return_predecessors=True)
    way = [int(end_node)]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    row, column = np.nonzero(inside)
    picked = np.array(way[::-1])
    return np.column_stack([column[picked], row[picked]]).astype(float)
