"""Shoots: side twigs placed around their bearers by a divergence angle, and how they bend as they grow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.foliage_twigs import across
from forestgen.tree.grow.axes import continuation
from forestgen.tree.grow.crown_volume import CrownVolume
from forestgen.tree.limbs import unit
from forestgen.tree.skeleton import Skeleton, height_above_tips

STEPS = 5  # internodes of a shoot
SHORT_END = 0.4  # length of the shoot next to its bearer's tip, over that of one far from it
UNEVEN = 0.2  # relative standard deviation of the lengths
JITTER = np.deg2rad(12)  # standard deviation of divergence and insertion
WANDER = 0.10  # random turn of each internode, of a unit vector


@dataclass(frozen=True, kw_only=True)
class ShootRules:
    """How shoots stand and bend. Lengths in metres, angles in radians."""

    length: float
    spacing: float  # between the nodes of a bearer
    divergence: float  # from one node of the bearer to the next
    per_node: int  # shoots at one node, evenly around it
    insertion: float  # between bearer and shoot
    plagiotropism: float  # share by which a shoot turns level, across the sunlight; below 0: upright
    rigidity: float  # 1: does not bend by its own weight


@dataclass(frozen=True, eq=False)
class Buds:
    """Where shoots start. S shoots."""

    node: NDArray[np.int64]  # (S,) of the skeleton
    heading: NDArray[np.float64]  # (S, 3) unit
    length: NDArray[np.float64]  # (S,) m

    def __len__(self) -> int:
        return len(self.node)

    def take(self, pick: NDArray[np.int64] | NDArray[np.bool_]) -> Buds:
        return Buds(self.node[pick], self.heading[pick], self.length[pick])


def buds_on(skeleton: Skeleton, bears: NDArray[np.bool_], rules: ShootRules, *, rng: np.random.Generator) -> Buds:
    """Buds on the bearing nodes (N,): one node's at each `spacing` along a branch, turned on by the divergence."""
    onward = continuation(skeleton)
    along, axis = _along_axes(skeleton, onward)
    rank = np.floor(along / rules.spacing).astype(np.int64)
    before = np.where(np.arange(len(axis)) == axis, -1, rank[np.maximum(skeleton.parent, 0)])
    at = np.flatnonzero(bears & (rank > before) & (rank > 0))
    turn = rng.uniform(0, 2 * np.pi, len(axis))
    if abs(np.sin(rules.divergence)) < 1e-6:  # two ranks: sprays lie level
        turn = np.zeros(len(axis))
    phase = turn[axis[at]] + rank[at] * rules.divergence
    left = height_above_tips(skeleton.position, skeleton.parent)[at]
    share = SHORT_END + (1 - SHORT_END) * np.clip(left / (2 * rules.length), 0, 1)
    at, phase, share = (np.repeat(value, rules.per_node) for value in (at, phase, share))
    phase = phase + np.tile(np.arange(rules.per_node), len(at) // rules.per_node) * 2 * np.pi / rules.per_node
    phase += rng.normal(0, JITTER, len(at))
    forward = _forward(skeleton, onward)[at]
    side, up = across(forward)
    outward = np.cos(phase)[:, None] * side + np.sin(phase)[:, None] * up
    angle = rules.insertion + rng.normal(0, JITTER, len(at))
    heading = np.cos(angle)[:, None] * forward + np.sin(angle)[:, None] * outward
    length = rules.length * share * np.clip(rng.normal(1, UNEVEN, len(at)), 0.4, 1.6)
    return Buds(at, unit(heading), length)


def grow_shoots(
    skeleton: Skeleton, buds: Buds, volume: CrownVolume, rules: ShootRules, *, rng: np.random.Generator
) -> Skeleton:
    """The skeleton with its buds grown out, each as far as the crown reaches; the new nodes' radii are NaN."""
    n, s = len(skeleton), len(buds)
    place, heading = skeleton.position[buds.node], buds.heading
    step = buds.length / STEPS
    path = np.empty((s, STEPS, 3))
    grows, ends = np.ones(s, bool), np.zeros(s, np.int64)
    for k in range(STEPS):
        heading = bent(heading + rng.normal(0, WANDER, heading.shape), rules, 1 / STEPS)
        tip = place + step[:, None] * heading
        may_pass, may_end = volume.allows(tip)
        grows &= may_pass & volume.spans(place, tip)
        ends = np.where(grows & may_end, k + 1, ends)
        path[:, k], place = tip, tip
    kept = np.arange(STEPS) < ends[:, None]
    index = n - 1 + np.cumsum(kept.ravel()).reshape(kept.shape)
    above = np.column_stack([buds.node, index[:, :-1]])
    return Skeleton(
        np.concatenate([skeleton.position, path[kept]]),
        np.concatenate([skeleton.parent, above[kept]]),
        np.concatenate([skeleton.radius, np.full(int(kept.sum()), np.nan)]),
    )


def bent(heading: NDArray[np.float64], rules: ShootRules, share: float) -> NDArray[np.float64]:
    """Headings (S, 3) after `share` of a shoot's growth: turned to the level or the light, drawn down by weight."""
    flat = unit(heading * [1.0, 0.0, 1.0] + 1e-9)
    wish = flat if rules.plagiotropism >= 0 else np.array([0.0, 1.0, 0.0])
    turn = 1 - (1 - min(abs(rules.plagiotropism), 1.0)) ** share
    turned = unit(unit(heading) * (1 - turn) + wish * turn)
    lever = np.hypot(turned[:, 0], turned[:, 2])  # weight bends what lies, not what hangs or stands
    return unit(turned - [0.0, 1.0, 0.0] * (share * (1 - rules.rigidity) * lever)[:, None])


def _along_axes(skeleton: Skeleton, onward: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Way from the foot of its branch to each node (N,), metres, and the branch's first own node (N,)."""
    parent = skeleton.parent.tolist()
    step = np.linalg.norm(skeleton.position - skeleton.position[np.maximum(skeleton.parent, 0)], axis=1).tolist()
    carries = onward.tolist()
    along, axis = [0.0] * len(parent), list(range(len(parent)))
    for node in range(1, len(parent)):
        above = parent[node]
        along[node] = step[node]
        if carries[above] == node:
            axis[node] = axis[above]
            along[node] += along[above]
    return np.array(along), np.array(axis)


def _forward(skeleton: Skeleton, onward: NDArray[np.int64]) -> NDArray[np.float64]:
    """Unit directions (N, 3) of the branches at their nodes: from the node before to the one after."""
    node = np.arange(len(skeleton))
    ahead = np.where(onward >= 0, onward, node)
    way = skeleton.position[ahead] - skeleton.position[np.maximum(skeleton.parent, 0)]
    return np.where(np.linalg.norm(way, axis=1, keepdims=True) > 0, unit(way), [[0.0, 1.0, 0.0]])
