"""Skeleton: the branching structure in metres, and the passes over it that every stage uses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze


def is_topological(parent: NDArray[np.int64]) -> bool:
    """Whether node 0 is the only root and every other node comes after its parent."""
    if not len(parent) or parent[0] != -1:
        return False
    above = parent[1:]
    return bool(np.all((above >= 0) & (above < np.arange(1, len(parent)))))


def n_children(parent: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number of children of each node (N,)."""
    return np.bincount(parent[1:], minlength=len(parent)).astype(np.int64)


def tips_beyond(parent: NDArray[np.int64]) -> NDArray[np.int64]:
    """How many tips lie beyond each node (N,); 1 at a tip: the particles that flowed together there."""
    count = (n_children(parent) == 0).astype(np.int64).tolist()
    above = parent.tolist()
    for node in range(len(count) - 1, 0, -1):
        count[above[node]] += count[node]
    return np.array(count, np.int64)


def path_length(position: NDArray[np.float64], parent: NDArray[np.int64]) -> NDArray[np.float64]:
    """Length along the branches from the root to each node (N,), in the units of position."""
    length = np.zeros(len(parent))
    step = np.linalg.norm(position[1:] - position[parent[1:]], axis=1)
    for node in range(1, len(parent)):
        length[node] = length[parent[node]] + step[node - 1]
    return length


def main_child(weight: NDArray[np.float64], parent: NDArray[np.int64]) -> NDArray[np.int64]:
    """The child of greatest weight of each node (N,), -1 at tips: it continues the branch."""
    best = np.full(len(parent), -1, np.int64)
    for node in range(len(parent) - 1, 0, -1):  # backwards: the earliest child wins a tie
        above = parent[node]
        if best[above] < 0 or weight[node] >= weight[best[above]]:
            best[above] = node
    return best


def last_tip(continues: NDArray[np.int64]) -> NDArray[np.int64]:
    """The tip (N,) that the branch through each node ends in; `continues` (N,) is from `main_child`."""
    tip = np.arange(len(continues))
    for node in range(len(tip) - 1, -1, -1):
        if continues[node] >= 0:
            tip[node] = tip[continues[node]]
    return tip


def branch_order(parent: NDArray[np.int64], continues: NDArray[np.int64]) -> NDArray[np.int64]:
    """Generation of the branch that each node belongs to (N,): trunk 0, its side branches 1, ...

    `continues` is the child (N,) that carries the branch on, from `main_child`.
    """
    order = np.zeros(len(parent), np.int64)
    for node in range(1, len(parent)):
        above = parent[node]
        order[node] = order[above] + (continues[above] != node)
    return order


def height_above_tips(position: NDArray[np.float64], parent: NDArray[np.int64]) -> NDArray[np.float64]:
    """Length of the longest way from each node to a tip beyond it (N,), in the units of position."""
    reach = np.zeros(len(parent))
    step = np.linalg.norm(position[1:] - position[parent[1:]], axis=1)
    for node in range(len(parent) - 1, 0, -1):
        above = parent[node]
        reach[above] = max(reach[above], reach[node] + step[node - 1])
    return reach


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A rooted branching structure in metres, Y up. N nodes; node 0 is the root."""

    position: NDArray[np.float64]  # (N, 3)
    parent: NDArray[np.int64]  # (N,) parent[0] == -1, else parent[i] < i
    radius: NDArray[np.float64]  # (N,) NaN where not yet known

    def __post_init__(self) -> None:
        freeze(self, position=(np.float64, "N", 3), parent=(np.int64, "N"), radius=(np.float64, "N"))
        if not is_topological(self.parent):
            raise ValueError("node 0 must be the only root, and parents must come before their children")
        if np.isnan(self.position).any():
            raise ValueError("Skeleton.position holds NaN")

    def __len__(self) -> int:
        return len(self.parent)
