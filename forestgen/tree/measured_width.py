"""MeasuredWidth: widths from the distance transform are kept, all other wood tapers (Kim & Jeong 2014, sec. II.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.radius import slender_unseen, trunk_radius
from forestgen.tree.skeleton import Skeleton, height_above_tips, main_child
from forestgen.tree.strategy import Strategy
from forestgen.tree.view import View


@dataclass(frozen=True, kw_only=True)
class MeasuredWidth(Strategy):
    """Widths that a photo shows, and wood that thins evenly from them to its tips where none does.

    A branch that no photo shows begins with a share of its bearer's radius and thins in proportion to
    the way that is left to its tip.
    """

    ratio: float = 0.6  # a branch's radius over its bearer's where it leaves; "scaling factor on the parent-child
    # branches" (sec. II.3), its value is not given
    tip: float = 0.012  # of the trunk's radius: no wood is thinner; ours: 3 mm on a trunk of 50 cm
    slender: float = 0.06  # ours, of the trunk's radius; unmeasured wood no thicker than this is too thin to be seen
    # before the sky where the photos show none; 0: it is as thick as elsewhere

    def __post_init__(self) -> None:
        if not 0 < self.ratio <= 1:
            raise ValueError(f"ratio is {self.ratio}; expected a share above 0")
        if not 0 < self.tip <= 1:
            raise ValueError(f"tip is {self.tip}; expected a share above 0")

    def __call__(self, skeleton: Skeleton, views: Sequence[View]) -> Skeleton:
        radius = measured_width(skeleton, self.ratio, self.tip)
        return replace(skeleton, radius=slender_unseen(skeleton, views, radius, self.slender))


def measured_width(skeleton: Skeleton, ratio: float, tip: float) -> NDArray[np.float64]:
    """Radii (N,) in metres: positive, never growing on the way from the root to a tip.

    A node between two measured ones of its branch lies between them; one beyond the last has the
    share of its radius that is left of the way to the tip.
    """
    trunk = trunk_radius(skeleton)
    least = tip * trunk
    parent = skeleton.parent.tolist()
    reach = height_above_tips(skeleton.position, skeleton.parent)
    onward = main_child(reach, skeleton.parent).tolist()
    left, measured = reach.tolist(), skeleton.radius.tolist()  # plain lists: a loop over them is faster
    beyond = [0.0] * len(parent)  # the largest radius measured farther out
    for node in range(len(parent) - 1, 0, -1):
        known = max(beyond[node], measured[node]) if measured[node] >= 0 else beyond[node]
        beyond[parent[node]] = max(beyond[parent[node]], known)
    radius = [measured[0] if measured[0] > least else trunk] * len(parent)
    for node in range(1, len(parent)):
        above = parent[node]
        most = radius[above]
        if measured[node] >= 0:
            own = measured[node]
        elif onward[above] == node:
            own = most * left[node] / left[above] if left[above] > 0 else most
        else:
            own = ratio * most
        radius[node] = min(max(own, least, beyond[node] if not measured[node] >= 0 else 0.0), most)
    return np.array(radius)
