"""Direction field: which way a particle is driven at each place of a photo (Neubert et al. 2007, sec. 7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.arrays import freeze

Blend = Literal["linear", "constant"]
MARGIN = 0.02  # by which a field reaches beyond what it must cover, share of its longer side


@dataclass(frozen=True, eq=False)
class DirectionField:
    """Directions on a grid over a photo, V rows by U columns of corners; outside it the border's count."""

    vector: NDArray[np.float64]  # (V, U, 2) x right, y down; at most 1 long
    low: NDArray[np.float64]  # (2,) px, where corner (0, 0) lies
    step: NDArray[np.float64]  # (2,) px, from corner to corner in x and y

    def __post_init__(self) -> None:
        freeze(self, vector=(np.float64, "V", "U", 2), low=(np.float64, 2), step=(np.float64, 2))
        if min(self.vector.shape[:2]) < 2 or not (self.step > 0).all():
            raise ValueError("DirectionField: expected at least 2 x 2 corners and positive steps")

    def at(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Directions (N, 2) at pixels (N, 2), bilinear between the four corners around each."""
        rows, columns = self.vector.shape[:2]
        place = np.clip((xy - self.low) / self.step, 0, [columns - 1, rows - 1])
        cell = np.minimum(place.astype(np.int64), [columns - 2, rows - 2])
        u, v = (place - cell).T[..., None]
        i, j = cell.T
        above = self.vector[j, i] * (1 - u) + self.vector[j, i + 1] * u
        below = self.vector[j + 1, i] * (1 - u) + self.vector[j + 1, i + 1] * u
        return np.asarray(above * (1 - v) + below * v)


def direction_field(
    xy: NDArray[np.float64],
    parent: NDArray[np.int64],
    box: NDArray[np.float64],
    *,
    resolution: int = 100,
    blend: Blend = "linear",
    reach: float,
    share: float = 0.5,
) -> DirectionField:
    """The field of an attractor graph with nodes at xy (N, 2) px over a box (2, 2): low and high corner, px.

    Equation 3: f = h(d) v + (1 - h(d)) t, with v the unit vector to the nearest place on the graph, t
    the graph's unit tangent there, towards the root, and d the distance. A linear h rises from 0 on
    the graph to 1 at `reach` px; a constant h is `share` wherever d > 0.
    """
    low, high = _with_margin(box)
    step = (high - low) / (resolution - 1)
    corner = low + np.stack(np.meshgrid(*[np.arange(resolution)] * 2, indexing="xy"), axis=-1) * step
    place, tangent, _ = graph_points(xy, parent, 0.25 * float(step.min()))
    distance, nearest = cKDTree(place).query(corner.reshape(-1, 2))
    towards = (place[nearest] - corner.reshape(-1, 2)) / np.maximum(distance, 1e-9)[:, None]
    h = blending(distance, blend, reach, share)[:, None]
    vector = h * towards + (1 - h) * tangent[nearest]
    return DirectionField(vector.reshape(resolution, resolution, 2), low, step)


def blending(distance: NDArray[np.float64], blend: Blend, reach: float, share: float) -> NDArray[np.float64]:
    """The share h (N,) of the vector to the graph, at distances (N,) from it (eq. 3)."""
    if blend == "constant":
        return np.where(distance > 0, share, 0.0)
    return np.minimum(distance / reach, 1.0)


def graph_points(
    position: NDArray[np.float64], parent: NDArray[np.int64], spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Places (P, D) at most `spacing` apart along a graph's edges, their unit tangents (P, D) to the root, their nodes.

    A place belongs to the node at the outer end of its edge.

    At a node the tangent is that of the edge to its parent; at the root, which has none, that of an
    edge that arrives there. A graph of one node has tangent 0.
    """
    child = np.arange(1, len(parent))
    way = position[parent[child]] - position[child]
    length = np.linalg.norm(way, axis=1)
    count = np.maximum(np.ceil(length / spacing), 1).astype(np.int64)
    edge = np.repeat(child - 1, count)
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    place = position[child[edge]] + way[edge] * (within / count[edge])[:, None]
    unit = way / np.maximum(length, 1e-300)[:, None]
    first = unit[:1] if len(child) else np.zeros((1, position.shape[1]))
    node = np.concatenate([[0], child[edge]])
    return np.concatenate([position[:1], place]), np.concatenate([first, unit[edge]]), node


def _with_margin(box: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    extra = MARGIN * float(np.max(box[1] - box[0])) + 1e-6
    return box[0] - extra, box[1] + extra
