"""DaVinci: a branch's cross-section is the sum of those it divides into (Neubert et al. 2007, sec. 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.radius import slender_unseen, trunk_radius
from forestgen.tree.skeleton import Skeleton, n_children, tips_beyond
from forestgen.tree.strategy import Strategy
from forestgen.tree.view import View

FAINT_PX = 0.2  # radius of unmeasured wood before the sky: a flow's tufts hang on it, so it shows when seen from near
STEEPEST = 0.05  # metres of radius that measured wood loses on a metre of way, where thin wood goes on from thick


@dataclass(frozen=True, kw_only=True)
class DaVinci(Strategy):
    """Radii from the number of particles that each segment gathers: the tips beyond it (Holton 1994).

    At a fork r ** exponent = constant * (sum of the branches' r ** exponent), and each branch's part of
    that sum is its part of the tips. The stem's measured radius sets the scale.
    """

    exponent: float = 2.0  # sec. 8: r^2 = a * sum of r_i^2; Murray's law would have 3
    constant: float = 1.0  # sec. 8: "a is a constant", not given; Da Vinci's own is 1
    measured: bool = True  # ours; what the photos show as thick keeps its radius. The paper knows no radii
    slender: float = 0.06  # ours, of the trunk's radius; unmeasured wood no thicker than this is hardly seen before
    # the sky where the photos show none; 0: it is as thick as elsewhere

    def __post_init__(self) -> None:
        if not 1 <= self.exponent <= 6:
            raise ValueError(f"exponent is {self.exponent}; expected 1 to 6 (2: areas add up)")
        if not 1 <= self.constant <= 2:
            raise ValueError(f"constant is {self.constant}; expected 1 to 2: below 1 branches outgrow their bearers")

    def __call__(self, skeleton: Skeleton, views: Sequence[View]) -> Skeleton:
        tips = tips_beyond(skeleton.parent)
        share = radius_shares(skeleton.parent, tips, self.exponent, self.constant)
        stem = stem_radius(skeleton, tips)
        unknown = np.full(len(skeleton), np.nan)
        radius = tapered(skeleton.parent, share, stem, unknown)
        if self.measured:
            radius = tapered(skeleton.parent, share, stem, without_stumps(skeleton, radius))
        return replace(skeleton, radius=slender_unseen(skeleton, views, radius, self.slender, FAINT_PX))


def stem_radius(skeleton: Skeleton, tips: NDArray[np.int64]) -> float:
    """Radius of the stem below its first fork, metres: the median of what was measured there.

    Where nothing was, the largest radius measured anywhere, else one from the tree's size.
    """
    known = skeleton.radius[(tips == tips[0]) & (skeleton.radius > 0)]
    return float(np.median(known)) if len(known) else trunk_radius(skeleton)


def radius_shares(
    parent: NDArray[np.int64], tips: NDArray[np.int64], exponent: float = 2.0, constant: float = 1.0
) -> NDArray[np.float64]:
    """Radius (N,) of each node over its parent's, of a tree whose nodes have `tips` (N,) beyond them; 1 at the root."""
    forks = n_children(parent) > 1
    share = np.ones(len(parent))
    share[1:] = tips[1:] / tips[parent[1:]] / np.where(forks[parent[1:]], constant, 1.0)
    return np.asarray(share ** (1 / exponent))


def without_stumps(skeleton: Skeleton, rule: NDArray[np.float64]) -> NDArray[np.float64]:
    """Measured radii (N,) in metres, drawn in where they would end in a step down to those of the `rule` (N,)."""
    position, parent = skeleton.position, skeleton.parent
    step = np.linalg.norm(position - position[np.maximum(parent, 0)], axis=1)
    most, above, steps = rule.tolist(), parent.tolist(), (STEEPEST * step).tolist()
    measured, usual = skeleton.radius.tolist(), rule.tolist()  # NaN fails every comparison
    for node in range(len(above) - 1, 0, -1):
        own = min(measured[node], most[node]) + steps[node] if measured[node] > 0 else usual[node]
        most[above[node]] = max(most[above[node]], own)
    return np.asarray(np.minimum(skeleton.radius, most))


def tapered(
    parent: NDArray[np.int64], share: NDArray[np.float64], stem: float, known: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Radii (N,) in metres, from the root's, `stem`, outward: each is its `share` (N,) of the one before it.

    Where a radius is `known` (N,), NaN elsewhere, it holds instead; but nothing grows outward, nor is
    anything thinner than what was measured beyond it.
    """
    above, shares = parent.tolist(), share.tolist()
    measured = known.tolist()  # NaN fails every comparison
    beyond = [0.0] * len(above)
    for node in range(len(above) - 1, -1, -1):
        if measured[node] > beyond[node]:
            beyond[node] = measured[node]
        if node and beyond[node] > beyond[above[node]]:
            beyond[above[node]] = beyond[node]
    radius = [stem] * len(above)
    for node in range(1, len(above)):
        before = radius[above[node]]
        own = beyond[node] if measured[node] > 0 else max(before * shares[node], beyond[node])
        radius[node] = min(own, before)
    return np.array(radius)
