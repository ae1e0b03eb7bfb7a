"""The drawn tree with twigs, leaves on it, and what they cover."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.foliage import LeavesAlongBranches
from forestgen.tree.model import Atlas, Leaves
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View


def twiggy(skeleton: Skeleton, per_node: int = 60, reach: float = 0.5) -> Skeleton:
    """The drawn tree with thin twigs around its tips, thrown as its leaf discs are."""
    rng = np.random.default_rng(1)
    tips = np.setdiff1d(np.arange(len(skeleton)), skeleton.parent)
    position, parent = [skeleton.position], [skeleton.parent]
    end = np.repeat(skeleton.position[tips], per_node, axis=0) + rng.normal(0, reach / 1.7, (len(tips) * per_node, 3))
    start = np.repeat(tips, per_node)
    for share in (0.33, 0.66, 1.0):
        n = sum(map(len, position))
        position.append(skeleton.position[np.repeat(tips, per_node)] * (1 - share) + end * share)
        parent.append(start)
        start = n + np.arange(len(end))
    radius = np.concatenate([skeleton.radius, np.full(3 * len(end), 0.006)])
    return Skeleton(np.concatenate(position), np.concatenate(parent), radius)


def grow(skeleton: Skeleton, view: View, atlas: Atlas, seed: int = 0, **fields: object) -> Leaves:
    strategy = LeavesAlongBranches(**fields)  # type: ignore[arg-type]
    return strategy(skeleton, [view], atlas, rng=np.random.default_rng(seed))


def rotation(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrices (L, 3, 3) of unit quaternions w x y z, by turning the axes: q v q*."""
    w, v = quaternion[:, :1], quaternion[:, 1:]
    columns = []
    for axis in np.eye(3):
        t = 2 * np.cross(v, axis)
        columns.append(axis + w * t + np.cross(v, t))
    return np.stack(columns, axis=2)


def drawn(leaves: Leaves, view: View, atlas: Atlas) -> NDArray[np.bool_]:
    """What leaves cover in the photo: every triangle of every leaf, filled, its texture's holes ignored."""
    mask = np.zeros(view.mattes.foliage.shape, np.uint8)
    turn = rotation(leaves.orientation) * leaves.size[:, None, None]
    for k, prototype in enumerate(atlas.prototypes):
        for m, p in zip(turn[leaves.prototype == k], leaves.position[leaves.prototype == k], strict=True):
            xy = view.camera.project(prototype.points @ m.T + p) - 0.5
            for face in prototype.faces:
                cv2.fillPoly(mask, [np.round(xy[face] * 16).astype(np.int32)], 1, shift=4)
    return mask > 0
