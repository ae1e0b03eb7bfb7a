"""Skeletons of known shape for the mesh's tests and benchmark."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.skeleton import Skeleton


def polyline(points: list[list[float]], radius: float | list[float]) -> Skeleton:
    """An unbranched skeleton."""
    position = np.array(points, float)
    return Skeleton(
        position, np.arange(len(position)) - 1, np.broadcast_to(np.asarray(radius, float), len(position)).copy()
    )


def fork(*, side_radius: float = 0.1, angle_deg: float = 50.0) -> Skeleton:
    """A trunk of 0.2 m that goes straight up to 4 m, and a side branch that leaves it 2 m up."""
    turn = np.deg2rad(angle_deg)
    side = [[np.sin(turn) * s, 2 + np.cos(turn) * s, 0.0] for s in (0.5, 1.0, 1.5)]
    position = np.array([[0, 0, 0], [0, 1, 0], [0, 2, 0], [0, 3, 0], [0, 4, 0], *side], float)
    parent = np.array([-1, 0, 1, 2, 3, 2, 5, 6])
    return Skeleton(position, parent, np.array([0.2] * 5 + [side_radius] * 3))


def random_tree(n_nodes: int, *, rng: np.random.Generator) -> Skeleton:
    """A tree of `n_nodes` nodes, mostly twigs of two to six nodes; the pipe model gives the radii."""
    position = [np.array([0.0, 0.3 * k, 0.0]) for k in range(20)]
    parent = list(range(-1, 19))
    while len(position) < n_nodes:
        node = int(rng.integers(10, len(position)))
        heading: NDArray[np.float64] = position[node] - position[parent[node]]
        heading = heading / np.linalg.norm(heading) + rng.normal(0, 0.6, 3)
        long = rng.uniform(0.05, 0.2)
        for _ in range(min(int(rng.integers(2, 7)), n_nodes - len(position))):
            heading = heading / np.linalg.norm(heading) + rng.normal(0, 0.15, 3)
            parent.append(node)
            node = len(position)
            position.append(position[parent[-1]] + long * heading / np.linalg.norm(heading))
    area = np.zeros(n_nodes)
    for node in range(n_nodes - 1, 0, -1):
        area[node] = max(area[node], 1.0)
        area[parent[node]] += area[node]
    area[0] = area[1]
    return Skeleton(np.array(position), np.array(parent), 0.003 * area**0.43)
