"""DaVinci: a branch's cross-section is the sum of those it divides into (Neubert et al. 2007, sec. 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.radius import trunk_radius
from forestgen.tree.skeleton import Skeleton, n_children
from forestgen.tree.strategy import Strategy
from forestgen.tree.view import View


@dataclass(frozen=True, kw_only=True)
class DaVinci(Strategy):
    """Radii from the number of particles that each segment gathers: the tips beyond it (Holton 1994).

    At a fork r ** exponent = constant * (sum of the branches' r ** exponent), and each branch's part of
    that sum is its part of the tips. The stem's measured radius sets the scale.
    """

    exponent: float = 2.0  # sec. 8: r^2 = a * sum of r_i^2; Murray's law would have 3
    constant: float = 1.0  # sec. 8: "a is a constant", not given; Da Vinci's own is 1
    measured: bool = True  # ours; the paper knows no radii: branches are no thicker than the photos show them

    def __post_init__(self) -> None:
        if not 1 <= self.exponent <= 6:
            raise ValueError(f"exponent is {self.exponent}; expected 1 to 6 (2: areas add up)")
        if not 1 <= self.constant <= 2:
            raise ValueError(f"constant is {self.constant}; expected 1 to 2: below 1 branches outgrow their bearers")

    def __call__(self, skeleton: Skeleton, views: Sequence[View]) -> Skeleton:
        tips = tips_beyond(skeleton.parent)
        most = skeleton.radius if self.measured else np.full(len(skeleton), np.nan)
        radius = da_vinci_radius(skeleton.parent, tips, stem_radius(skeleton, tips), self.exponent, self.constant, most)
        return replace(skeleton, radius=radius)


def tips_beyond(parent: NDArray[np.int64]) -> NDArray[np.int64]:
    """How many tips lie beyond each node (N,); 1 at a tip: the particles that flowed together there."""
    count = (n_children(parent) == 0).astype(np.int64).tolist()
    above = parent.tolist()
    for node in range(len(count) - 1, 0, -1):
        count[above[node]] += count[node]
    return np.array(count, np.int64)


def stem_radius(skeleton: Skeleton, tips: NDArray[np.int64]) -> float:
    """Radius of the stem below its first fork, metres: the median of what was measured there.

    Where nothing was, the largest radius measured anywhere, else one from the tree's size.
    """
    known = skeleton.radius[(tips == tips[0]) & (skeleton.radius > 0)]
    return float(np.median(known)) if len(known) else trunk_radius(skeleton)


def da_vinci_radius(
    parent: NDArray[np.int64],
    tips: NDArray[np.int64],
    stem: float,
    exponent: float = 2.0,
    constant: float = 1.0,
    most: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Radii (N,) in metres of a tree whose root has the radius `stem` and whose nodes have `tips` (N,) beyond them.

    No node is thicker than `most` (N,) where that is known; NaN elsewhere. Thickness never grows from
    the root to a tip.
    """
    forks = n_children(parent) > 1
    share = np.ones(len(parent))
    share[1:] = tips[1:] / tips[parent[1:]] / np.where(forks[parent[1:]], constant, 1.0)
    factor = (share ** (1 / exponent)).tolist()
    above = parent.tolist()
    limit = np.full(len(parent), np.inf).tolist() if most is None else np.where(most > 0, most, np.inf).tolist()
    radius = [stem] * len(above)
    for node in range(1, len(above)):
        radius[node] = min(radius[above[node]] * factor[node], limit[node])
    return np.array(radius)
