"""Drawn in: visible branches that lifting carried out of the crown bend back, where they are in the picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.tree.grow.axes import axes_of
from forestgen.tree.grow.turned_outline import TurnedOutline
from forestgen.tree.skeleton import Skeleton

FREE = 0.9  # of the crown's depth: a node less far out stays where it is
LEAST = 0.5  # of the greatest depth that a node is given anywhere, so that forks below the crown stay open
BEND = 0.2  # of a branch's length: over so much of it the way back in is spread, so that there is no elbow


def drawn_in(skeleton: Skeleton, camera: Camera, turned: TurnedOutline, stem: int = 0) -> Skeleton:
    """The skeleton with its branches bent along the camera's rays to within the crown's depth.

    A branch goes with what bears it. Its trunk leads through the node `stem`.
    """
    position = skeleton.position
    across, up, depth = (position @ turned.axes.T).T
    most = np.maximum(turned.reach(across, up), LEAST * turned.depth.max())
    if (np.abs(depth) <= FREE * most).all():
        return skeleton
    placed = depth.copy()
    for axis in axes_of(skeleton, stem):
        begin, nodes = axis.nodes[0], axis.nodes[1:]
        wanted = placed[begin] + depth[nodes] - depth[begin]
        within = _within(wanted, most[nodes])
        if (within != wanted).any():
            along = np.cumsum(np.linalg.norm(np.diff(position[axis.nodes], axis=0), axis=1))
            within = placed[begin] + _smooth(along, within - placed[begin], BEND * float(along[-1]))
        placed[nodes] = within
    moved = np.flatnonzero(placed != depth)
    position = position.copy()
    position[moved] = camera.unproject(camera.project(position[moved]), placed[moved])
    return replace(skeleton, position=position)


def _within(depth: NDArray[np.float64], most: NDArray[np.float64]) -> NDArray[np.float64]:
    """Depths (N,) that come ever more slowly near to the most that they may be (N,), before or behind the trunk."""
    over = np.maximum(np.abs(depth) - FREE * most, 0) / ((1 - FREE) * most)
    near = (FREE + (1 - FREE) * np.tanh(over)) * most * np.sign(depth)
    return np.where(over > 0, near, depth)


def _smooth(along: NDArray[np.float64], value: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Values (K,) at ways along a branch (K,), metres, averaged by a Gaussian; 0 stays where the branch begins."""
    piece = np.diff(along, prepend=0.0)
    mirrored = np.concatenate([-along[::-1], along])
    weight = np.exp(-0.5 * ((along[:, None] - mirrored) / max(sigma, 1e-12)) ** 2)
    weight *= np.concatenate([piece[::-1], piece])
    return np.asarray(weight @ np.concatenate([-value[::-1], value]) / weight.sum(axis=1))
