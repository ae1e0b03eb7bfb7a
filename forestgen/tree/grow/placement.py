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

    def only(self, which: int) -> Placements:
        """One of the placements by itself."""
        part = slice(self.start[which], self.start[which + 1])
        parent = self.parent[part]
        return Placements(
            self.position[part],
            self.foot[part],
            np.where(parent < 0, -1, parent - part.start),
            self.at[part],
            self.group[part] - self.group[part.start],
            np.array([0, len(parent)]),
        )


def place(line: NDArray[np.float64], subtrees: Sequence[Subtree], n_rotations: int) -> Placements:
    """Put each subtree on the branch along a polyline (P, 3), in turn by each rotation about it.

    The scale makes the supporting branch as long as this one; what starts at a share of the support
    starts at the same share of the branch, and follows the branch's direction there.
    """
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    length = float(along[-1])
    turns = _turns(n_rotations)
    position, foot, parent, at, group, sizes = [], [], [], [], [], []
    n_nodes, n_groups = 0, 0
    for subtree in subtrees:
        feet, frames = _frames(line, along, subtree.at)
        away = subtree.position - np.column_stack([np.zeros(len(subtree)), subtree.at, np.zeros(len(subtree))])
        turned = np.einsum("rij,kj->rki", turns, away)
        placed = feet + length * np.einsum("kij,rkj->rki", frames, turned)
        position.append(placed.reshape(-1, 3))
        foot.append(np.tile(feet, (n_rotations, 1)))
        shift = n_nodes + np.arange(n_rotations)[:, None] * len(subtree)
        parent.append(np.where(subtree.parent < 0, -1, subtree.parent + shift).ravel())
        at.append(np.tile(subtree.at, n_rotations))
        many = int(subtree.branch.max()) + 1
        group.append((subtree.branch + n_groups + np.arange(n_rotations)[:, None] * many).ravel())
        sizes += [len(subtree)] * n_rotations
        n_nodes += n_rotations * len(subtree)
        n_groups += n_rotations * many
    start = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    return Placements(
        np.concatenate(position), np.concatenate(foot), np.concatenate(parent), np.concatenate(at),
        np.concatenate(group), start,
    )  # fmt: skip


def _turns(count: int) -> NDArray[np.float64]:
    """Rotations (R, 3, 3) about +Y, evenly round."""
    angle = np.arange(count) * (2 * np.pi / count)
    turns = np.zeros((count, 3, 3))
    turns[:, 0, 0] = turns[:, 2, 2] = np.cos(angle)
    turns[:, 0, 2], turns[:, 2, 0] = np.sin(angle), -np.sin(angle)
    turns[:, 1, 1] = 1
    return turns


def _frames(
    line: NDArray[np.float64], along: NDArray[np.float64], at: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (K, 3) of a polyline at shares of its length (K,), and frames (K, 3, 3) that take +Y to its direction."""
    shares, back = np.unique(at, return_inverse=True)
    point, low, high = (point_at(line, along, np.clip(shares + d, 0, 1)) for d in (0, -WINDOW, WINDOW))
    direction = (high - low) / np.maximum(np.linalg.norm(high - low, axis=1, keepdims=True), 1e-12)
    frames = np.array([turn_to_y(one).T for one in direction])
    return point[back], frames[back]


def point_at(
    line: NDArray[np.float64], along: NDArray[np.float64], share: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Points (K, 3) of a polyline (P, 3) at shares (K,) of its length; `along` (P,) is the way to each vertex."""
    return np.column_stack([np.interp(share * along[-1], along, line[:, k]) for k in range(3)])
