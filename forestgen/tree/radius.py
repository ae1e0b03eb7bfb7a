"""Radius rules: how thick every node of a skeleton is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.radius_unseen import UNSEEN_PX, unseen_radius
from forestgen.tree.skeleton import Skeleton, branch_order, height_above_tips, main_child
from forestgen.tree.strategy import Strategy
from forestgen.tree.view import View

UNMEASURED_TRUNK = 1 / 60  # trunk radius over the longest way to a tip, where no photo shows it: a tree of 9 m, 30 cm


@dataclass(frozen=True, kw_only=True)
class ConstantRatio(Strategy):
    """Radius as a fixed share of the parent branch's (Tan et al. 2008, sec. 2).

    A branch is a way from its base to a tip that goes on, at every fork, into the child with the
    longest way still to go; all other children begin a new branch of the next generation. The
    radius is constant along a branch.
    """

    ratio: float = 0.75  # a child branch's radius over its parent's (Tan 2008, sec. 2)

    def __call__(self, skeleton: Skeleton, views: Sequence[View]) -> Skeleton:
        return replace(skeleton, radius=constant_ratio(skeleton, self.ratio))


@dataclass(frozen=True, kw_only=True)
class MeasuredTaper(Strategy):
    """Measured radii are kept; all other wood tapers between and beyond them by a pipe model.

    Each stretch of wood is as thick as what it carries asks for: radius ** exponent is in
    proportion to the length of all wood from here to the tips, so that the powers add up at a fork
    (Da Vinci's rule; Murray's law would have exponent 3) and every branch thins towards its end.
    """

    exponent: float = 2.3  # between Da Vinci's 2 and Murray's 3; Tan 2008 (sec. 2) leaves "better rules" open
    twig_share: float = 0.012  # radius of the thinnest twig over the trunk's; ours: 3 mm on a trunk of 50 cm
    slender: float = 0.06  # of the trunk's radius; unmeasured wood no thicker than this is too thin to be seen before
    # the sky where the photos show none; 0: it is as thick as elsewhere

    def __call__(self, skeleton: Skeleton, views: Sequence[View]) -> Skeleton:
        radius = measured_taper(skeleton, self.exponent, self.twig_share)
        return replace(skeleton, radius=slender_unseen(skeleton, views, radius, self.slender))


def slender_unseen(
    skeleton: Skeleton,
    views: Sequence[View],
    radius: NDArray[np.float64],
    slender: float,
    most_px: float = UNSEEN_PX,
) -> NDArray[np.float64]:
    """Radii (N,), metres, with unmeasured wood of up to `slender` of the trunk's too thin to be seen before the sky.

    There its radius is at most `most_px` of the photo's pixels.
    """
    unknown = np.isnan(skeleton.radius)
    if not (slender > 0 and unknown.any()):
        return radius
    may_thin = unknown & (radius <= slender * radius[0])
    return thinned(radius, np.where(may_thin, unseen_radius(skeleton, views, radius, most_px), np.inf), skeleton.parent)


def trunk_radius(skeleton: Skeleton) -> float:
    """Radius of the trunk at the root, metres: the largest that was measured, else from the tree's size."""
    known = skeleton.radius[np.isfinite(skeleton.radius)]
    if len(known) and known.max() > 0:
        return float(known.max())
    reach = height_above_tips(skeleton.position, skeleton.parent)[0]
    return float(reach if reach > 0 else 1.0) * UNMEASURED_TRUNK


def constant_ratio(skeleton: Skeleton, ratio: float) -> NDArray[np.float64]:
    """Radii (N,) in metres: the root's times `ratio` to the power of the branch's generation."""
    root = skeleton.radius[0]
    trunk = float(root) if np.isfinite(root) and root > 0 else trunk_radius(skeleton)
    reach = height_above_tips(skeleton.position, skeleton.parent)
    order = branch_order(skeleton.parent, main_child(reach, skeleton.parent))
    return trunk * ratio ** order.astype(float)


def measured_taper(skeleton: Skeleton, exponent: float, twig_share: float) -> NDArray[np.float64]:
    """Radii (N,) in metres: positive, and never growing on the way from the root to a tip.

    Top down, r = r_parent * (load / load_parent) ** (1 / exponent), but never thinner than what
    was measured further out, and never thicker than what was measured here.
    """
    n = len(skeleton)
    trunk = trunk_radius(skeleton)
    twig = trunk * twig_share
    load = carried_length(skeleton)
    parent = skeleton.parent
    share = np.ones(n)
    share[1:] = (load[1:] / load[parent[1:]]) ** (1 / exponent)

    above = parent.tolist()  # plain lists: a loop over them is five times faster than over arrays
    shares = share.tolist()
    measured = skeleton.radius.tolist()  # NaN fails every comparison below
    beyond = [twig] * n  # the largest radius measured from here outward
    for node in range(n - 1, -1, -1):
        if measured[node] > beyond[node]:
            beyond[node] = measured[node]
        if node and beyond[node] > beyond[above[node]]:
            beyond[above[node]] = beyond[node]
    radius = [measured[0] if measured[0] > twig else trunk] * n
    for node in range(1, n):
        most = radius[above[node]]
        known = measured[node]
        own = max(known, twig) if known >= 0 else max(most * shares[node], beyond[node])
        radius[node] = min(own, most)
    return np.array(radius)


def thinned(radius: NDArray[np.float64], most: NDArray[np.float64], parent: NDArray[np.int64]) -> NDArray[np.float64]:
    """Radii (N,) no greater than `most` (N,), and never growing on the way from the root to a tip."""
    out, above = np.minimum(radius, most).tolist(), parent.tolist()
    for node in range(1, len(out)):
        out[node] = min(out[node], out[above[node]])
    return np.array(out)


def carried_length(skeleton: Skeleton) -> NDArray[np.float64]:
    """Length of all wood from each node outward (N,), metres; each tip counts a thousandth of the whole besides."""
    parent = skeleton.parent
    step = np.linalg.norm(skeleton.position[1:] - skeleton.position[parent[1:]], axis=1)
    whole = float(step.sum())
    is_tip = np.bincount(parent[1:], minlength=len(parent)) == 0
    load = (is_tip * (1e-3 * whole if whole > 0 else 1.0)).tolist()
    above, steps = parent.tolist(), step.tolist()
    for node in range(len(load) - 1, 0, -1):
        load[above[node]] += load[node] + steps[node - 1]
    return np.array(load)
