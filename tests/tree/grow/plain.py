"""The plain version of the compiled loops and of the stored scores: slow, short, and measured afresh each time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow.attractors import Field, picture_plane
from forestgen.tree.grow.scores import PlacementRules

Points = NDArray[np.float64]


def distances(point: Points, a: Points, b: Points) -> Points:
    """Distance of each point (N, 3) to the nearest of the segments (M, 3), (M, 3); infinite where there is none."""
    if not len(a):
        return np.full(len(point), np.inf)
    along = b - a
    length2 = np.maximum((along**2).sum(axis=1), 1e-300)
    t = np.clip(((point[:, None] - a) * along).sum(axis=2) / length2, 0, 1)
    return np.linalg.norm(point[:, None] - a - t[:, :, None] * along, axis=2).min(axis=1)


class PlainScores:
    """Gains measured afresh: every attractor against every segment of every placement, each time."""

    def __init__(self, rules: PlacementRules, image: Sequence[Field], space: Field) -> None:
        self.rules, self.image, self.space = rules, image, space

    def cost(self, kind: str) -> float:
        return self.space.cost if kind == "space" else sum(one.cost for one in self.image)

    def gains(self, axis: int, line: Points, order: int, kind: str) -> Points:
        placed, stays = self.rules.placements(line, order)
        gain = []
        for begin, stop in zip(placed.start, placed.start[1:], strict=False):
            part = np.arange(begin, stop)[stays[begin:stop]]
            a, b = placed.before[part], placed.position[part]
            total = 0.0
            if kind == "space":
                total = self._fall(self.space, a, b)
            else:
                for camera, one in zip(self.rules.volume.cameras, self.image, strict=True):
                    total += self._fall(one, picture_plane(camera, a), picture_plane(camera, b))
            gain.append(total)
        return np.array(gain)

    def _fall(self, attractors: Field, a: Points, b: Points) -> float:
        return float(np.maximum(attractors.distance - distances(attractors.point, a, b), 0).sum())

    def grow(self, a: Points, b: Points) -> None:
        self._lower(self.space, a, b)
        for camera, one in zip(self.rules.volume.cameras, self.image, strict=True):
            self._lower(one, picture_plane(camera, a), picture_plane(camera, b))

    def _lower(self, attractors: Field, a: Points, b: Points) -> None:
        attractors.distance = np.minimum(attractors.distance, distances(attractors.point, a, b))


def prune(
    parent: NDArray[np.int64],
    group: NDArray[np.int64],
    length: Points,
    may_pass: NDArray[np.bool_],
    may_end: NDArray[np.bool_],
    share: float,
    shortest: float,
) -> NDArray[np.bool_]:
    stays = np.zeros(len(parent), bool)
    for branch in np.unique(group):
        nodes = np.flatnonzero(group == branch)
        kept: list[int] = []
        for node in nodes:
            if not may_pass[node] or (parent[node] >= 0 and not (stays[parent[node]] or parent[node] in kept)):
                break
            kept.append(int(node))
        while kept and not may_end[kept[-1]]:
            kept.pop()
        long = length[kept].sum()
        if kept and long >= shortest and long >= share * length[nodes].sum() - 1e-9:
            stays[kept] = True
    return stays
