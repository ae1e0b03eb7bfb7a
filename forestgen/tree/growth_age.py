"""Growth age: when each node of a finished skeleton was born (Kim & Jeong 2014, sec. II.3, eq. 5)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.skeleton import Skeleton, path_length

SLOWEST = 0.5  # a branch's birth advances at least so much as its way along the tree does, both as shares
BINS = 128  # places at which the amount of living wood is counted


def growth_age(skeleton: Skeleton, thickness_weight: float) -> NDArray[np.float64]:
    """The growth age T (N,) of eq. 5, without unit; infinite at the root: it is the oldest.

    The printed T = 1 / ||x_i - x_r||_geo + w EDT(x_i) adds a length's inverse to a length, so its weight
    depends on the picture's size. Here ways are shares of the tree's longest one and the distance
    transform is the radius as a share of the thickest.
    """
    way = path_length(skeleton.position, skeleton.parent)
    longest, thickest = float(way.max()), float(skeleton.radius.max())
    nearness = np.full(len(way), np.inf)
    np.divide(longest, way, out=nearness, where=way > 0)
    return np.asarray(nearness + thickness_weight * skeleton.radius / (thickest or 1.0))


def birth_order(skeleton: Skeleton, thickness_weight: float) -> NDArray[np.float64]:
    """1 / T of each node (N,), scaled to 0 at the root and 1 at the youngest node.

    No node comes before its parent, and none long before those that stand as far out: along a branch
    1 / T rises at least SLOWEST times as fast as the way from the root, so that nothing appears at once.
    """
    way = path_length(skeleton.position, skeleton.parent)
    order = 1 / growth_age(skeleton, thickness_weight)
    share = way / (float(way.max()) or 1.0)
    for node in range(1, len(order)):
        above = skeleton.parent[node]
        order[node] = max(order[node], order[above] + SLOWEST * (share[node] - share[above]))
    return order / (float(order.max()) or 1.0)


def birth_times(skeleton: Skeleton, thickness_weight: float, wood_weight: float, last: float) -> NDArray[np.float64]:
    """When each node is born (N,), between 0 and `last` of the whole time.

    Time goes by the order of birth and, with `wood_weight`, by the length of all wood born so far:
    by order alone the few metres of a bare trunk take as long as the crown's kilometres.
    """
    order, parent = birth_order(skeleton, thickness_weight), skeleton.parent
    length = np.linalg.norm(skeleton.position[1:] - skeleton.position[parent[1:]], axis=1)
    begin, span = order[parent[1:]], np.maximum(order[1:] - order[parent[1:]], 1e-12)
    at = np.linspace(0, 1, BINS + 1)
    wood = np.array([np.sum(length * np.clip((here - begin) / span, 0, 1)) for here in at])
    if wood[-1] <= 0:
        return np.zeros(len(order))
    return np.asarray(last * ((1 - wood_weight) * order + wood_weight * np.interp(order, at, wood / wood[-1])))
