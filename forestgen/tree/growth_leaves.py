"""Leaves over time: a bud on its shoot unfolds, and turns to where it looks when the tree is finished."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.foliage_poses import quaternions
from forestgen.tree.growth import Anchors, GrowingTree, Pose, Wood
from forestgen.tree.growth_binding import bind_leaves
from forestgen.tree.limbs import unit

BUD_WIDTH = 0.35  # how wide and deep a bud is, as a share of an open leaf's proportions


@dataclass(frozen=True, eq=False)
class GrowingLeaves:
    """L leaves of a finished tree, bound to it."""

    anchors: Anchors
    wood: Wood  # under each
    scale: NDArray[np.float64]  # (L, 3) in the finished tree
    orientation: NDArray[np.float64]  # (L, 4) w x y z in the finished tree
    bud: NDArray[np.float64]  # (L, 4) as a bud, along its shoot

    def position_at(self, tree: GrowingTree, at: Pose) -> NDArray[np.float32]:
        """The feet (L, 3) of the stalks."""
        return tree.carried(self.anchors, at, tree.thickness(self.wood, at.time))

    def scale_at(self, tree: GrowingTree, time: float) -> NDArray[np.float32]:
        """The leaves' scales (L, 3): a bud is narrow; 0 before it shows. A leaf is no smaller on a small tree."""
        x = opened(tree, self.wood.born, time)
        wide = width(x)
        whole = 1.0 if tree.mode.is_ordered else tree.size(time)
        return np.asarray(whole * self.scale * np.stack([wide, x, wide], axis=1), np.float32)

    def orientation_at(self, tree: GrowingTree, at: Pose) -> NDArray[np.float64]:
        """The leaves' quaternions (L, 4): from the bud's to the open leaf's, carried by the bent branch."""
        own = slerp(self.bud, self.orientation, opened(tree, self.wood.born, at.time))
        return multiply(quaternions(at.turn[self.anchors.node]), own)


def opened(tree: GrowingTree, born: NDArray[np.float64], time: float) -> NDArray[np.float64]:
    """How far leaves (L,) on wood born at `born` are open: 0 a bud not yet seen, 1 unfolded.

    All are open where nothing is ordered.
    """
    if not tree.mode.is_ordered:
        return np.ones(len(born))
    x = np.clip((time - born - tree.growth.budding) / tree.growth.unfolding, 0, 1)
    return np.asarray(x * x * (3 - 2 * x))


def width(openness: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share (L,) of its last width and depth that a leaf so far open has."""
    return openness * (BUD_WIDTH + (1 - BUD_WIDTH) * openness)


def bound_leaves(
    tree: GrowingTree, position: NDArray[np.float64], orientation: NDArray[np.float64], scale: NDArray[np.float64]
) -> GrowingLeaves:
    """Bind leaves at (L, 3), turned by (L, 4) w x y z and scaled by (L, 3), to the tree that grows."""
    anchors = bind_leaves(position, tree.skeleton)
    orientation = orientation / np.linalg.norm(orientation, axis=1, keepdims=True)
    rest, parent = tree.skeleton.position, tree.skeleton.parent
    shoot = unit(rest[anchors.node] - rest[np.maximum(parent[anchors.node], 0)])
    bud = multiply(shortest_turn(blade(orientation), shoot), orientation)
    return GrowingLeaves(anchors, tree.wood(anchors), scale, orientation, bud)


def blade(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where the blade's +Y points (L, 3) after a turn (L, 4)."""
    w, x, y, z = q.T
    return np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], axis=1)


def shortest_turn(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternions (L, 4) that turn unit vectors (L, 3) into others; none where there is no one shortest turn."""
    q = np.concatenate([1 + np.sum(a * b, axis=1, keepdims=True), np.cross(a, b)], axis=1)
    length = np.linalg.norm(q, axis=1, keepdims=True)
    return np.where(length > 1e-3, q / np.maximum(length, 1e-3), [1.0, 0.0, 0.0, 0.0])


def multiply(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Products of quaternions (L, 4): first q, then p."""
    a, b, c, d = p.T
    w, x, y, z = q.T
    rows = [
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    ]
    return np.stack(rows, axis=1)


def slerp(p: NDArray[np.float64], q: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternions (L, 4) on the shorter way from p to q, at shares (L,)."""
    cosine = np.sum(p * q, axis=1)
    angle = np.arccos(np.clip(np.abs(cosine), 0, 1))
    sine = np.sin(angle)
    far = sine > 1e-6
    safe = np.where(far, sine, 1)
    a = np.where(far, np.sin((1 - t) * angle) / safe, 1 - t) * np.where(cosine < 0, -1, 1)
    b = np.where(far, np.sin(t * angle) / safe, t)
    out = a[:, None] * p + b[:, None] * q
    return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))
