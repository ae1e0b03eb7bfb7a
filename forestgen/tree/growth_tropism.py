"""Gravitropism: how far each branch unit bends while it ages (Kim & Jeong 2014, sec. II.3, eq. 6-8)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.skeleton import Skeleton, height_above_tips, main_child, path_length


def bend_of_units(skeleton: Skeleton, strength: float) -> NDArray[np.float64]:
    """The angle (N,) in radians by which the unit that ends at each node bends in its life.

    A branch bends by `strength` (radians) between where it leaves its parent and its end, dealt out by
    the units' lengths: so the strength means the same however finely a skeleton is divided. The paper
    gives every unit the same strength, and so a finer skeleton a stronger bend.

    A unit turns about rho x g (eq. 7) by its angle times the sine between the two, so that nothing
    bends past the plumb line. Of eq. 8 as printed the last entry is 0 and must be 1, the axis is not
    made a unit vector, and the signs are those of the transpose: by them a positive strength lifts
    and a negative one droops, as in figure 8.
    """
    position, parent = skeleton.position, skeleton.parent
    way = path_length(position, parent)
    unit = way - way[np.maximum(parent, 0)]
    continues = main_child(height_above_tips(position, parent) + unit, parent)  # the longest way onward
    base, tip = np.zeros(len(parent), np.int64), np.arange(len(parent))
    for node in range(1, len(parent)):
        above = parent[node]
        base[node] = base[above] if continues[above] == node else above
    for node in range(len(parent) - 1, -1, -1):
        if continues[node] >= 0:
            tip[node] = tip[continues[node]]
    length = way[tip] - way[base]
    return np.asarray(strength * unit / np.where(length > 0, length, 1.0))
