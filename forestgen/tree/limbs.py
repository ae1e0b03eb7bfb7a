"""Limbs: a skeleton cut into unbranched runs, each to be swept as one tube."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.skeleton import Skeleton, main_child, n_children

COINCIDENT = 1e-6  # nodes nearer to their parent than this share of the tree's size are one point
SHARPEST = np.cos(np.deg2rad(100.0))  # a sharper turn ends the limb: no ring can be mitred around it
STRAIGHTER = 0.05  # among children about equally thick the straighter continues: how much that weighs


@dataclass(frozen=True, eq=False)
class Limbs:
    """L limbs with K knots in all, limb after limb, each from its base to its end.

    The base of a side limb is the node of its parent limb that it leaves from, so that node is a
    knot of both. A limb comes after the limb it stands on.
    """

    node: NDArray[np.int64]  # (K,) skeleton node of each knot
    first: NDArray[np.int64]  # (M,) M = L + 1: knots first[l] .. first[l + 1] are limb l's
    parent: NDArray[np.int64]  # (L,) the limb it stands on, -1 for the trunk
    socket: NDArray[np.int64]  # (L,) the knot of the parent limb where it leaves, -1 for the trunk
    is_tip: NDArray[np.bool_]  # (L,) whether nothing goes on from its end

    def __post_init__(self) -> None:
        freeze(
            self,
            node=(np.int64, "K"),
            first=(np.int64, "M"),
            parent=(np.int64, "L"),
            socket=(np.int64, "L"),
            is_tip=(np.bool_, "L"),
        )

    def __len__(self) -> int:
        return len(self.parent)

    @property
    def limb(self) -> NDArray[np.int64]:
        """The limb of each knot (K,)."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))

    @property
    def has_next(self) -> NDArray[np.bool_]:
        """Whether a knot (K,) is followed by another of its limb."""
        inner = np.ones(len(self.node), bool)
        inner[self.first[1:] - 1] = False
        return inner


def unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (..., 3) of length 1; a zero vector stays zero."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.asarray(vector / np.where(length > 0, length, 1.0))


def tree_size(position: NDArray[np.float64]) -> float:
    """Diagonal of the box around points (N, 3): the length that tolerances are shares of."""
    return float(np.linalg.norm(np.ptp(position, axis=0)))


def ancestor_where(parent: NDArray[np.int64], stops: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The nearest node (N,) from each node towards the root, itself included, that stops."""
    up = np.where(stops, np.arange(len(parent)), parent)
    while not np.array_equal(up, jump := up[up]):
        up = jump
    return up


def merge_coincident(skeleton: Skeleton) -> Skeleton:
    """Drop nodes that lie on their parent; their children hang on to the parent."""
    step = np.linalg.norm(skeleton.position[1:] - skeleton.position[skeleton.parent[1:]], axis=1)
    keeps = np.concatenate([[True], step > COINCIDENT * tree_size(skeleton.position)])
    if keeps.all():
        return skeleton
    stands_for = ancestor_where(skeleton.parent, keeps)
    new_index = np.cumsum(keeps) - 1
    parent = new_index[stands_for[skeleton.parent[keeps]]]
    parent[0] = -1
    return Skeleton(skeleton.position[keeps], parent, skeleton.radius[keeps])


def plant(skeleton: Skeleton, depth: float) -> Skeleton:
    """Put a node `depth` metres below the root, so that the trunk starts in the ground.

    A root without any branch becomes a bud as tall as it is thick.
    """
    if len(skeleton) == 1:
        bud = skeleton.position + np.array([0.0, max(float(skeleton.radius[0]), depth), 0.0])
        skeleton = Skeleton(np.concatenate([skeleton.position, bud]), np.array([-1, 0]), skeleton.radius[[0, 0]])
    below = skeleton.position[:1] - [0.0, depth, 0.0]
    return Skeleton(
        np.concatenate([below, skeleton.position]),
        np.concatenate([[-1], skeleton.parent + 1]),
        skeleton.radius[np.concatenate([[0], np.arange(len(skeleton))])],
    )


def thickest_child(skeleton: Skeleton) -> NDArray[np.int64]:
    """The child (N,) that carries each node's limb on, -1 at tips: the thickest.

    Of children equally thick within a few percent it is the straightest.
    """
    ahead, parent = directions(skeleton), skeleton.parent
    straight = np.ones(len(skeleton))
    straight[1:] = np.sum(ahead[1:] * ahead[parent[1:]], axis=1)
    return main_child(skeleton.radius * (1 + STRAIGHTER * straight), parent)


def directions(skeleton: Skeleton) -> NDArray[np.float64]:
    """Unit direction (N, 3) in which each node lies from its parent; up for the root."""
    step = skeleton.position[1:] - skeleton.position[skeleton.parent[1:]]
    return np.concatenate([[[0.0, 1.0, 0.0]], unit(step)])


def without_hairpins(skeleton: Skeleton, continues: NDArray[np.int64]) -> NDArray[np.int64]:
    """The continuing children (N,) without those past a needle-sharp turn, where the limb ends.

    Between nodes closer together than the limb's radius a turn is noise of the tracing.
    """
    ahead, parent = directions(skeleton), skeleton.parent
    long = np.full(len(skeleton), np.inf)
    long[1:] = np.linalg.norm(skeleton.position[1:] - skeleton.position[parent[1:]], axis=1)
    node = np.flatnonzero(continues >= 0)
    after = continues[node]
    sharp = np.sum(ahead[node] * ahead[after], axis=1) < SHARPEST
    sharp &= np.minimum(long[node], long[after]) > skeleton.radius[node] / 2
    sharp &= node > 0
    return np.where(np.isin(np.arange(len(skeleton)), node[sharp]), -1, continues)


def limbs_along(skeleton: Skeleton, continues: NDArray[np.int64]) -> Limbs:
    """Cut a skeleton into limbs: each goes on to the child (N,) that continues it, -1 where it ends.

    The root must continue.
    """
    parent, index = skeleton.parent, np.arange(len(skeleton))
    is_head = np.ones(len(skeleton), bool)
    is_head[1:] = continues[parent[1:]] != index[1:]
    head = ancestor_where(parent, is_head)
    order = np.argsort(head, kind="stable")  # within a limb indices rise from base to end
    heads = index[is_head]
    begin = np.searchsorted(head[order], heads)
    node = np.insert(order, begin[1:], parent[heads[1:]])
    count = np.bincount(head, minlength=len(skeleton))[heads] + (heads > 0)
    first = np.concatenate([[0], np.cumsum(count)])
    limb_of_node = np.searchsorted(heads, head)
    knot_of_node = np.empty(len(skeleton), np.int64)
    is_own = np.ones(len(node), bool)
    is_own[first[1:-1]] = False
    knot_of_node[node[is_own]] = np.flatnonzero(is_own)
    base = parent[heads]
    limbs = Limbs(
        node=node,
        first=first,
        parent=np.where(base >= 0, limb_of_node[base], -1),
        socket=np.where(base >= 0, knot_of_node[base], -1),
        is_tip=n_children(parent)[node[first[1:] - 1]] == 0,
    )
    return limbs
