"""GrowingTree: the tree while it grows; nodes and axes are only ever added."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow.axes import Axis, axes_of
from forestgen.tree.grow.placement import Placements
from forestgen.tree.skeleton import Skeleton

RATIO = 0.75  # of a branch's radius to its bearer's, to rank branches with (sec. 2)


class GrowingTree:
    """Nodes, axes and their radii; begins as the visible skeleton, whose nodes keep their indices."""

    def __init__(self, skeleton: Skeleton, stem: int = 0) -> None:
        self.n_visible = len(skeleton)
        self.position: NDArray[np.float64] = skeleton.position
        self.parent: NDArray[np.int64] = skeleton.parent
        self.axes: list[Axis] = axes_of(skeleton, stem)
        self._visible_radius = skeleton.radius
        self.radius: list[float] = []  # of each axis, to rank it
        for axis in self.axes:
            bearer = self.radius[axis.bearer] if axis.bearer >= 0 else 1.0
            measured = skeleton.radius[axis.nodes[min(1, len(axis.nodes) - 1)]]
            self.radius.append(float(measured) if np.isfinite(measured) else RATIO * bearer)

    def lead(self, points: NDArray[np.float64]) -> None:
        """Carry the trunk on through points (P, 3)."""
        first = len(self.parent)
        trunk = self.axes[0]
        above = np.concatenate([trunk.nodes[-1:], np.arange(first, first + len(points))])[: len(points)]
        self.position = np.concatenate([self.position, points])
        self.parent = np.concatenate([self.parent, above])
        self.axes[0] = replace(trunk, nodes=np.concatenate([trunk.nodes, np.arange(first, first + len(points))]))

    def bear(self, axis: int, foot: int, points: NDArray[np.float64]) -> None:
        """Let an axis bear a new one along points (P, 3), from its node number `foot` on."""
        first, start = len(self.parent), int(self.axes[axis].nodes[foot])
        new = np.arange(first, first + len(points))
        self.position = np.concatenate([self.position, points])
        self.parent = np.concatenate([self.parent, [start], new[:-1]])
        self.axes.append(Axis(np.concatenate([[start], new]), self.axes[axis].order + 1, axis))
        self.radius.append(RATIO * self.radius[axis])

    @property
    def skeleton(self) -> Skeleton:
        """The tree as it stands; radius NaN at new nodes."""
        radius = np.full(len(self.parent), np.nan)
        radius[: self.n_visible] = self._visible_radius
        return Skeleton(self.position, self.parent, radius)

    def segments(self, first: int = 1) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Ends (M, 3), (M, 3) of the segments to the nodes from `first` on."""
        first = max(first, 1)
        return self.position[self.parent[first:]], self.position[first:]

    def line(self, axis: int) -> NDArray[np.float64]:
        """The polyline (P, 3) of an axis, metres."""
        return self.position[self.axes[axis].nodes]

    def add(self, axis: int, placed: Placements, stays: NDArray[np.bool_]) -> None:
        """Append those nodes (M,) of a placement on an axis that stay, and their branches as axes."""
        position, parent = list(self.position), list(self.parent)
        node = np.full(len(stays), -1, np.int64)  # of the placement -> of the tree
        axis_of: dict[int, int] = {}  # branch of the placement -> axis
        for begin, stop in _runs(placed.group, stays):
            above = int(placed.parent[begin])
            if above < 0:
                start, bearer = self._foot(axis, float(placed.at[begin])), axis
            else:
                start, bearer = int(node[above]), axis_of[int(placed.group[above])]
            nodes = [start]
            for m in range(begin, stop):
                parent.append(nodes[-1])
                position.append(placed.position[m])
                node[m] = len(parent) - 1
                nodes.append(len(parent) - 1)
            axis_of[int(placed.group[begin])] = len(self.axes)
            self.axes.append(Axis(np.array(nodes), self.axes[bearer].order + 1, bearer))
            self.radius.append(RATIO * self.radius[bearer])
        self.position, self.parent = np.array(position), np.array(parent)

    def _foot(self, axis: int, share: float) -> int:
        """The node of an axis nearest to a share of its length."""
        line = self.line(axis)
        along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        return int(self.axes[axis].nodes[np.argmin(np.abs(along - share * along[-1]))])


def _runs(group: NDArray[np.int64], stays: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Begin and stop of what stays of each branch: always its first nodes, as branches are cut from the tip."""
    runs = []
    begin = np.flatnonzero(np.diff(group, prepend=-1))
    for first, last in zip(begin, [*begin[1:], len(group)], strict=True):
        many = int(stays[first:last].sum())
        if many:
            runs.append((int(first), int(first) + many))
    return runs
