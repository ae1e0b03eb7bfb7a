"""Placement: a library subtree put on a branch, in every one of its rotations (Tan et al. 2008, sec. 3.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow.subtree_library import Subtree, turn_to_y

WINDOW = 0.08  # of the support's length to both sides, over which its direction is taken


@dataclass(frozen=True, eq=False)
class Placements:
    """C placements of subtrees on one branch, one behind the other. M nodes in all."""

    position: NDArray[np.float64]  # (M, 3) m
    foot: NDArray[np.float64]  # (M, 3) m, where the node's outermost ancestor leaves the support
    parent: NDArray[np.int64]  # (M,) into the M nodes, -1 on the support
    at: NDArray[np.float64]  # (M,) share of the support's length at the foot
    group: NDArray[np.int64]  # (M,) one number a new branch, rising
    start: NDArray[np.int64]  # (C + 1,) nodes start[c] to start[c + 1] are placement c

    @property
    def before(self) -> NDArray[np.float64]:
        """The point (M, 3) from which each node's segment comes."""
        return np.where((self.parent < 0)[:, None], self.foot, self.position[self.parent])

    @property
    def length(self) -> NDArray[np.float64]:
        """Of each node's segment (M,), metres."""
        return np.asarray(np.linalg.norm(self.position - self.before, axis=1))


@dataclass(frozen=True, eq=False)
class Patterns:
    """Subtrees in each of their rotations, one behind the other, ready to be put on branches. M nodes."""

    away: NDArray[np.float64]  # (M, 3) from the foot, in lengths of the support
    share: NDArray[np.float64]  # (U,) the shares of the support's length at which anything starts, rising
    foot: NDArray[np.int64]  # (M,) into share
    parent: NDArray[np.int64]  # (M,) into the M nodes, -1 on the support
    group: NDArray[np.int64]  # (M,) one number a branch, rising
    start: NDArray[np.int64]  # (C + 1,) nodes start[c] to start[c + 1] are pattern c

    def only(self, which: int) -> Patterns:
        """One of the patterns by itself."""
        part = slice(self.start[which], self.start[which + 1])
        parent, group = self.parent[part], self.group[part]
        own = np.where(parent < 0, -1, parent - part.start)
        ends = np.array([0, len(parent)])
        return Patterns(self.away[part], self.share, self.foot[part], own, group - group[:1], ends)


def patterns(subtrees: Sequence[Subtree], n_rotations: int) -> Patterns:
    """The subtrees, each turned evenly round its supporting branch `n_rotations` times."""
    if not subtrees:
        nothing = np.zeros(0, np.int64)
        return Patterns(np.zeros((0, 3)), np.zeros(0), nothing, nothing, nothing, np.zeros(1, np.int64))
    turns = _turns(n_rotations)
    away, at, parent, group, sizes = [], [], [], [], [0]
    n_nodes, n_groups = 0, 0
    for subtree in subtrees:
        from_foot = subtree.position - subtree.at[:, None] * [0.0, 1.0, 0.0]
        many = int(subtree.branch.max()) + 1
        for turn in turns:
            away.append(from_foot @ turn.T)
            at.append(subtree.at)
            parent.append(np.where(subtree.parent < 0, -1, subtree.parent + n_nodes))
            group.append(subtree.branch + n_groups)
            sizes.append(len(subtree))
            n_nodes += len(subtree)
            n_groups += many
    share, foot = np.unique(np.concatenate(at), return_inverse=True)
    return Patterns(
        np.concatenate(away), share, foot, np.concatenate(parent), np.concatenate(group), np.cumsum(sizes)
    )  # fmt: skip


def place(line: NDArray[np.float64], wanted: Patterns) -> Placements:
    """Put patterns on the branch along a polyline (P, 3).

    The scale makes the supporting branch as long as this one; what starts at a share of the support
    starts at the same share of the branch, and follows the branch's direction there.
    """
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    feet = point_at(line, along, wanted.share)
    ahead = point_at(line, along, np.minimum(wanted.share + WINDOW, 1))
    behind = point_at(line, along, np.maximum(wanted.share - WINDOW, 0))
    direction = (ahead - behind) / np.maximum(np.linalg.norm(ahead - behind, axis=1, keepdims=True), 1e-12)
    frames = np.swapaxes(turn_to_y(direction), 1, 2)[wanted.foot] * along[-1]
    foot = feet[wanted.foot]
    position = foot + np.matmul(frames, wanted.away[:, :, None])[:, :, 0]
    return Placements(position, foot, wanted.parent, wanted.share[wanted.foot], wanted.group, wanted.start)


def _turns(count: int) -> NDArray[np.float64]:
    """Rotations (R, 3, 3) about +Y, evenly round."""
    angle = np.arange(count) * (2 * np.pi / count)
    turns = np.zeros((count, 3, 3))
    turns[:, 0, 0] = turns[:, 2, 2] = np.cos(angle)
    turns[:, 0, 2], turns[:, 2, 0] = np.sin(angle), -np.sin(angle)
    turns[:, 1, 1] = 1
    return turns


def point_at(line: NDArray[np.float64], along: NDArray[np.float64], share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (K, 3) of a polyline (P, 3) at shares (K,) of its length; `along` (P,) is the way to each vertex."""
    return np.column_stack([np.interp(share * along[-1], along, line[:, k]) for k in range(3)])
