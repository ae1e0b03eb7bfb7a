"""Binary labels of least energy on the pixel grid, by graph cut. The only file that imports maxflow (GPL)."""

from __future__ import annotations

import maxflow  # noqa: TID251
import numpy as np
from numpy.typing import NDArray


def min_cut(
    cost_of_one: NDArray[np.floating],
    cost_of_zero: NDArray[np.floating],
    right: NDArray[np.floating],
    down: NDArray[np.floating],
) -> NDArray[np.bool_]:
    """Give each pixel (H, W) the label 0 or 1 so that the sum of all costs is least.

    `right` (H, W) is what it costs when a pixel and its right neighbour differ (last column unused),
    `down` the same for the neighbour below (last row unused). Costs are finite; those of neighbours >= 0.
    """
    if not cost_of_one.size:
        return np.zeros(cost_of_one.shape, bool)
    graph = maxflow.GraphFloat(cost_of_one.size, 2 * cost_of_one.size)
    nodes = graph.add_grid_nodes(cost_of_one.shape)
    to_right = np.array([[0, 0, 0], [0, 0, 1], [0, 0, 0]])
    to_below = np.array([[0, 0, 0], [0, 0, 0], [0, 1, 0]])
    graph.add_grid_edges(nodes, weights=right, structure=to_right, symmetric=True)
    graph.add_grid_edges(nodes, weights=down, structure=to_below, symmetric=True)
    graph.add_grid_tedges(nodes, cost_of_one, cost_of_zero)
    graph.maxflow()
    return np.asarray(graph.get_grid_segments(nodes))
