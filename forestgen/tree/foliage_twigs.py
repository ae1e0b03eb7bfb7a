"""Where leaves may grow: stations along young wood, denser towards the tips, in a phyllotactic order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.tree.skeleton import Skeleton, height_above_tips, last_tip, main_child, path_length

YOUNG = 0.06  # share of the tree's height: wood nearer to a tip than this is young and bears leaves
SLENDER = 0.05  # share of the trunk's radius below which wood is young however far the tip is
THIN = 0.2  # share of the trunk's radius above which wood bears no leaf, however near the tip
TIP_GAIN = 1.0  # how much denser leaves stand at a tip than at the foot of the young wood
CELL = 0.03  # share of the height: the cells whose wood is counted to even the crown out
EVEN = 0.5  # 0: leaves in proportion to the wood's length; 1: the same number in every cell that has wood


@dataclass(frozen=True, eq=False)
class YoungWood:
    """The edges of a skeleton that bear leaves. E edges."""

    start: NDArray[np.float64]  # (E, 3) m
    end: NDArray[np.float64]  # (E, 3) m
    radius: NDArray[np.float64]  # (E,) m
    along: NDArray[np.float64]  # (E,) m, way from the root to the start
    weight: NDArray[np.float64]  # (E,) relative number of leaves
    branch: NDArray[np.int64]  # (E,) the tip that the edge leads to, furthest of all: one number a branch

    def __len__(self) -> int:
        return len(self.radius)

    @property
    def length(self) -> NDArray[np.float64]:
        return np.asarray(np.linalg.norm(self.end - self.start, axis=1))


@dataclass(frozen=True, eq=False)
class Stations:
    """Places on twigs where a leaf is attached. S stations."""

    position: NDArray[np.float64]  # (S, 3) m, on the bark
    twig: NDArray[np.float64]  # (S, 3) unit, along the twig towards its tip
    outward: NDArray[np.float64]  # (S, 3) unit, away from the twig

    def __len__(self) -> int:
        return len(self.position)


def young_wood(skeleton: Skeleton) -> YoungWood:
    """The edges near the tips and thin enough to bear leaves; the tips' own edges always do."""
    position, parent = skeleton.position, skeleton.parent
    tall = float(np.ptp(position[:, 1])) or 1.0
    reach = height_above_tips(position, parent)
    radius = np.nan_to_num(skeleton.radius, nan=0.0)
    node = np.arange(1, len(skeleton))
    share = radius[node] / max(float(np.max(radius)), 1e-9)
    node = node[((reach[node] < YOUNG * tall) & (share <= THIN)) | (share <= SLENDER) | (reach[node] == 0)]
    node = node[np.linalg.norm(position[node] - position[parent[node]], axis=1) > 1e-9 * tall]
    start, end = position[parent[node]], position[node]
    length = np.linalg.norm(end - start, axis=1)
    near_tip = 1 + TIP_GAIN * np.exp(-reach[node] / (0.3 * YOUNG * tall))
    weight = length * near_tip / crowding(start + (end - start) / 2, length, CELL * tall) ** EVEN
    step = np.linalg.norm(position - position[np.maximum(parent, 0)], axis=1)
    tip = last_tip(main_child(reach + step, parent))
    return YoungWood(start, end, radius[node], path_length(position, parent)[parent[node]], weight, tip[node])


def crowding(point: NDArray[np.float64], length: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """Length of wood (E,) in the cubic cell (side in metres) that each point (E, 3) lies in."""
    index = np.floor(point / cell).astype(np.int64)
    _, which = np.unique(index, axis=0, return_inverse=True)
    return np.asarray(np.bincount(which.ravel(), length)[which.ravel()])


def spread_from_above(wood: YoungWood, cameras: Sequence[Camera], cell: float) -> float:
    """How much more of the ground than of the widest photo the wood stands over, at least 1.

    It is counted in square cells (side in metres): a flat crown shows little from the side.
    """
    middle = (wood.start + wood.end) / 2
    shadow = _n_cells(middle[:, [0, 2]], cell)
    shown = max(_n_cells(middle @ camera.axes[:2].T, cell) for camera in cameras)
    return max(1.0, shadow / shown)


def _n_cells(places: NDArray[np.float64], cell: float) -> int:
    """In how many square cells the places (E, 2) lie."""
    return len(np.unique(np.floor(places / cell).astype(np.int64), axis=0))


def place_stations(
    wood: YoungWood, count: float, turn: float, per_node: int, jitter: float, *, rng: np.random.Generator
) -> Stations:
    """About `count` stations along the wood in proportion to its weight.

    From one node of a branch to the next the leaves turn by `turn` radians about the twig; each node
    bears `per_node` of them, spread evenly around it. `jitter` is the spread of the turn, radians.
    """
    share = wood.weight / wood.weight.sum() * count / per_node
    n = np.floor(share + rng.random(len(wood))).astype(np.int64)
    edge = np.repeat(np.arange(len(wood)), n)
    rank = np.arange(len(edge)) - np.repeat(np.cumsum(n) - n, n)
    t = (rank + rng.uniform(0.1, 0.9, len(edge))) / n[edge]
    distance = wood.along[edge] + t * wood.length[edge]
    order = np.lexsort((distance, wood.branch[edge]))
    edge, t = edge[order], t[order]
    first = np.concatenate([[True], np.diff(wood.branch[edge]) != 0]) if len(edge) else np.zeros(0, bool)
    begin = np.maximum.accumulate(np.where(first, np.arange(len(edge)), 0))
    phase = (np.arange(len(edge)) - begin) * turn + wood.branch[edge] * 2.399963
    edge, t, phase = (np.repeat(value, per_node) for value in (edge, t, phase))
    phase += np.tile(np.arange(per_node), len(edge) // per_node) * 2 * np.pi / per_node
    phase += rng.normal(0, jitter, len(phase))

    twig = (wood.end - wood.start)[edge] / wood.length[edge][:, None]
    side, up = across(twig)
    outward = np.cos(phase)[:, None] * side + np.sin(phase)[:, None] * up
    on_axis = wood.start[edge] + t[:, None] * (wood.end - wood.start)[edge]
    return Stations(on_axis + outward * wood.radius[edge][:, None] * 0.9, twig, outward)


def across(axis: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two unit vectors (N, 3) across each unit axis (N, 3): one level, and one across both.

    An upright axis takes +X for level.
    """
    side = np.column_stack([axis[:, 2], np.zeros(len(axis)), -axis[:, 0]])
    length = np.linalg.norm(side, axis=1, keepdims=True)
    side = np.where(length > 1e-6, side / np.maximum(length, 1e-6), [[1.0, 0.0, 0.0]])
    return side, np.cross(axis, side)
