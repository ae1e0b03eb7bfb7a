"""Drawn in: visible branches that lifting carried out of the crown come back, where they are in the picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forestgen.camera import Camera
from forestgen.tree.grow.turned_outline import TurnedOutline
from forestgen.tree.skeleton import Skeleton

FREE = 0.75  # of the crown's depth: a node less far out stays where it is
LEAST = 0.35  # of the greatest depth that a node is given anywhere, so that forks below the crown stay open


def drawn_in(skeleton: Skeleton, camera: Camera, turned: TurnedOutline) -> Skeleton:
    """The skeleton with its nodes moved along the camera's rays to within the crown's depth."""
    local = skeleton.position @ turned.axes.T
    depth = np.maximum(turned.reach(local[:, 0], local[:, 1]), LEAST * turned.depth.max())
    away = np.abs(local[:, 2])
    over = np.maximum(away - FREE * depth, 0) / ((1 - FREE) * depth)
    out = np.flatnonzero(over > 0)
    if not len(out):
        return skeleton
    near = (FREE + (1 - FREE) * np.tanh(over[out])) * depth[out] * np.sign(local[out, 2])
    position = skeleton.position.copy()
    position[out] = camera.unproject(camera.project(position[out]), near)
    return replace(skeleton, position=position)
