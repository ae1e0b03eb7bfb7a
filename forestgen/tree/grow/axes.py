"""Axes: a skeleton as a list of branches, each from where it leaves its bearer to its tip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.skeleton import Skeleton, branch_order, height_above_tips, main_child
from forestgen.tree.view import View


@dataclass(frozen=True, eq=False)
class Axis:
    """One branch; P nodes. The first is the node of the bearer that it starts from (the trunk: the root)."""

    nodes: NDArray[np.int64]  # (P,)
    order: int  # generation: the trunk 0, its side branches 1, ...
    bearer: int  # index of the axis it grows on, -1 for the trunk


def continuation(skeleton: Skeleton) -> NDArray[np.int64]:
    """The child that carries each node's branch on (N,), -1 at tips: long ones and straight ones are preferred."""
    position, parent = skeleton.position, skeleton.parent
    step = np.zeros_like(position)
    step[1:] = position[1:] - position[parent[1:]]
    step[0] = [0.0, 1.0, 0.0]  # trees stand
    length = np.linalg.norm(step, axis=1)
    before = np.maximum(parent, 0)
    cosine = (step * step[before]).sum(axis=1) / np.maximum(length * length[before], 1e-12)
    reach = height_above_tips(position, parent) + length
    return main_child(reach * np.maximum(cosine, 0.05) ** 2, parent)


def stem_end(skeleton: Skeleton, view: View) -> int:
    """The node at which the trunk that was drawn ends: the one nearest to the end of the first stroke."""
    away = view.camera.project(skeleton.position) - view.strokes.branches[0][-1]
    return int(np.argmin((away**2).sum(axis=1)))


def axes_of(skeleton: Skeleton, stem: int = 0) -> list[Axis]:
    """The axes of a skeleton, bearers first; the trunk leads through the node `stem`."""
    parent = skeleton.parent
    continues = continuation(skeleton)
    while stem > 0:
        continues[parent[stem]] = stem
        stem = int(parent[stem])
    order = branch_order(parent, continues)
    axis_of = np.zeros(len(parent), np.int64)
    axes: list[Axis] = []
    for node in range(len(parent)):
        above = int(parent[node])
        if above >= 0 and continues[above] == node:
            continue  # carries its bearer on
        own = [node]
        while continues[own[-1]] >= 0:
            own.append(int(continues[own[-1]]))
        bearer = -1 if above < 0 else int(axis_of[above])
        axis_of[own] = len(axes)
        axes.append(Axis(np.array(own if above < 0 else [above, *own]), int(order[node]), bearer))
    return axes
