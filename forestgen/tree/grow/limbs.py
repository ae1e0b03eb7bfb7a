"""Limbs: branches are replaced by library subtrees, each time the one that lowers the cost most (Tan et al. 2008)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow import kernels
from forestgen.tree.grow.attractors import Field, turn_about
from forestgen.tree.grow.growing_tree import GrowingTree
from forestgen.tree.grow.placement import Placements
from forestgen.tree.grow.scores import PlacementRules
from forestgen.tree.strategy import OnStep

KINDS = ("image", "space")  # the cost that drives, in turn
TRIES = 8  # of the best placements, before an iteration is given up as too crowded
BEARER_ROOM = 2.5  # nearness distances along a new branch within which its bearer may be near
START_ROOM = 1.3  # and any other branch: two that start at one place must part at once


class PlacementScores(Protocol):
    """What limbs need to know of placements; `scores.Scores` is fast, the tests have a plain one."""

    rules: PlacementRules
    space: Field

    def cost(self, kind: str) -> float: ...
    def gains(self, axis: int, line: NDArray[np.float64], order: int, kind: str) -> NDArray[np.float64]: ...
    def grow(self, a: NDArray[np.float64], b: NDArray[np.float64]) -> None: ...


@dataclass(frozen=True)
class LimbRules:
    """How limbs are grown; lengths in metres."""

    iterations: int
    n_candidates: int  # branches looked at in one iteration
    near: float  # a new branch ends where it comes this near to another
    min_gain: float  # share of the first cost; what gains less is not added
    patience: int  # iterations without an addition after which growth ends; 0: never


def grow_limbs(
    tree: GrowingTree, scores: PlacementScores, rules: LimbRules, *, rng: np.random.Generator, on_step: OnStep | None
) -> None:
    """Replace branches, alternately driven by image attractors and by attractors in space."""
    used: set[tuple[int, int]] = set()
    idle = 0
    least = {kind: rules.min_gain * scores.cost(kind) for kind in KINDS}
    for iteration in range(rules.iterations):
        kind = KINDS[iteration % 2]
        order = [axis.order for axis in tree.axes]
        drawn = draw_branches(np.array(tree.radius), order, rules.n_candidates, rng=rng)
        gain = {axis: scores.gains(axis, tree.line(axis), order[axis], kind) for axis in drawn}
        first = len(tree.parent)
        for axis, which in _best(gain, used, least[kind]):
            used.add((axis, which))
            if _replace(tree, scores.rules, axis, which, rules.near):
                break
        idle = 0 if len(tree.parent) > first else idle + 1
        if not idle:
            scores.grow(*tree.segments(first))
            add_turned_joints(tree, scores.space, first)
        if on_step is not None:
            costs = {"image cost": scores.cost("image"), "3-D cost": scores.cost("space")}
            on_step(iteration + 1, rules.iterations, costs)
        if rules.patience and idle >= rules.patience:
            break


def draw_branches(radius: NDArray[np.float64], order: list[int], count: int, *, rng: np.random.Generator) -> list[int]:
    """A small set of axes: thickest first, each taken with a probability of one over its generation."""
    ranked = np.argsort(-radius, kind="stable")
    taken = rng.random(len(ranked)) < 1.0 / (np.asarray(order)[ranked] + 1)
    return [int(axis) for axis in ranked[taken][:count]]


def _best(gain: dict[int, NDArray[np.float64]], used: set[tuple[int, int]], min_gain: float) -> list[tuple[int, int]]:
    """The (axis, placement) of the greatest gains, best first, that were not tried before."""
    found = []
    for axis, values in gain.items():
        for which in np.argsort(-values, kind="stable")[: TRIES + sum(1 for one, _ in used if one == axis)]:
            if values[which] > min_gain and (axis, int(which)) not in used:
                found.append((-float(values[which]), axis, int(which)))
    return [(axis, which) for _, axis, which in sorted(found)[:TRIES]]


def _replace(tree: GrowingTree, placement: PlacementRules, axis: int, which: int, near: float) -> bool:
    """Put one placement on the tree, without what is too near to other branches; whether anything was left."""
    one, stays = placement.placements(tree.line(axis), tree.axes[axis].order, which)
    left = stays & ~_crowded(tree, axis, one, near)
    left = placement.prune(one, left, left)
    if left.any():
        tree.add(axis, one, left)
    return bool(left.any())


def _crowded(tree: GrowingTree, bearer: int, placed: Placements, near: float) -> NDArray[np.bool_]:
    """Which nodes (M,) of a placement come too near to a branch that is there already, other than where they start."""
    own = np.zeros(len(tree.parent), bool)
    own[tree.axes[bearer].nodes] = True
    a, b = tree.segments()
    to_bearer = kernels.distance_to_segments(placed.position, a[own[1:]], b[own[1:]])
    to_others = kernels.distance_to_segments(placed.position, a[~own[1:]], b[~own[1:]])
    run = placed.length  # becomes the way from the supporting branch
    for m in np.flatnonzero(placed.parent >= 0):
        run[m] += run[placed.parent[m]]
    too_near = (to_bearer < near) & (run > BEARER_ROOM * near)
    return np.asarray(too_near | ((to_others < near) & (run > START_ROOM * near)))


def add_turned_joints(tree: GrowingTree, space: Field, first: int) -> None:
    """Turn the joints (forks and ends) among the nodes from `first` on by 90 degrees about the trunk: they attract."""
    many = np.bincount(tree.parent[1:], minlength=len(tree.parent))
    joints = np.flatnonzero(many != 1)
    joints = joints[(joints >= first) & (joints > 0)]
    trunk = tree.line(0)[-1] - tree.line(0)[0]
    axis = trunk / max(float(np.linalg.norm(trunk)), 1e-9)
    space.add(turn_about(tree.position[joints], axis), *tree.segments())
