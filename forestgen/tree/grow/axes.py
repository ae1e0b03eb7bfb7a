"""Axes: a skeleton as a list of branches, each from where it leaves its bearer to its tip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.skeleton import Skeleton, branch_order, height_above_tips, main_child


@dataclass(frozen=True, eq=False)
class Axis:
    """One branch; P nodes. The first is the node of the bearer that it starts from (the trunk: the root)."""

    nodes: NDArray[np.int64]  # (P,)
    order: int  # generation: the trunk 0, its side branches 1, ...
    bearer: int  # index of the axis it grows on, -1 for the trunk


def axes_of(skeleton: Skeleton) -> list[Axis]:
    """The axes of a skeleton, bearers first; the longest way to a tip carries each one on."""
    parent = skeleton.parent
    step = np.zeros(len(parent))
    step[1:] = np.linalg.norm(skeleton.position[1:] - skeleton.position[parent[1:]], axis=1)
    continues = main_child(height_above_tips(skeleton.position, parent) + step, parent)
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
