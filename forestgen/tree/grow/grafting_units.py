"""Units: L and Y shaped sub-branches with the visible skeleton's angles and sizes (Kim & Jeong 2014, fig. 7).

An L unit is one branch that leaves its bearer's side, a Y unit two that part at its tip. A unit has
three angles on its bearer, about the axes x, y, z of the paper: how far it leans away, how far it is
turned about the bearer from the unit before, and how it bends along itself; and its scale, its length
over the bearer's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.foliage_twigs import across
from forestgen.tree.grow.axes import Axis, axes_of
from forestgen.tree.grow.crown_volume import CrownVolume
from forestgen.tree.limbs import unit
from forestgen.tree.skeleton import Skeleton

NODES = 4  # of a unit's branch
SIGHT = 0.3  # of a branch: its direction where it begins and ends is seen over this share
FEWEST = 6  # branches that say something about all
UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Spread:
    """A parameter's middle and standard deviation, and the bounds that no unit leaves."""

    mean: float
    sigma: float
    low: float
    high: float

    def draw(self, n: int, *, rng: np.random.Generator) -> NDArray[np.float64]:
        return np.clip(rng.normal(self.mean, self.sigma, n), self.low, self.high)


@dataclass(frozen=True, kw_only=True)
class UnitForm:
    """The parameters of a tree's units. Angles in radians."""

    lean: Spread = Spread(np.deg2rad(45), np.deg2rad(12), np.deg2rad(15), np.deg2rad(85))
    turn: Spread = Spread(np.deg2rad(137.5), np.deg2rad(20), 0.0, 2 * np.pi)
    bend: Spread = Spread(np.deg2rad(10), np.deg2rad(12), np.deg2rad(-50), np.deg2rad(50))  # upward
    scale: Spread = Spread(0.55, 0.12, 0.25, 0.85)


def estimated_form(skeleton: Skeleton, stem: int, least: float) -> UnitForm:
    """The form of the visible tree's side branches of at least the length `least`, metres.

    Of few branches the form of most trees is taken, `UnitForm()`. `stem` is the node that the trunk leads through.
    """
    axes = axes_of(skeleton, stem)
    usual = UnitForm()
    sides = [axis for axis in axes[1:] if _length(skeleton, axis.nodes) >= least]
    if len(sides) < FEWEST:
        return usual
    found = np.array([_measured(skeleton, axis, axes[axis.bearer]) for axis in sides])
    turns = [
        np.mod(np.diff(found[[k for k, axis in enumerate(sides) if axis.bearer == bearer], 1]), 2 * np.pi)
        for bearer in sorted({axis.bearer for axis in sides})
    ]
    return UnitForm(
        lean=_spread(found[:, 0], usual.lean),
        turn=_circular(np.concatenate(turns), usual.turn),
        bend=_spread(found[:, 2], usual.bend),
        scale=_spread(found[:, 3], usual.scale),
    )


def _measured(skeleton: Skeleton, side: Axis, bearer: Axis) -> tuple[float, float, float, float]:
    """Lean, azimuth about the bearer, bend upward and scale of a side branch."""
    place = skeleton.position
    foot = int(np.flatnonzero(bearer.nodes == side.nodes[0])[0])
    ahead = place[bearer.nodes[min(foot + 1, len(bearer.nodes) - 1)]] - place[bearer.nodes[max(foot - 1, 0)]]
    ahead = unit(ahead[None])[0] if np.any(ahead) else UP
    k = max(1, round(SIGHT * (len(side.nodes) - 1)))
    first, last = unit(
        np.stack([place[side.nodes[k]] - place[side.nodes[0]], place[side.nodes[-1]] - place[side.nodes[-1 - k]]])
    )
    right, over = across(ahead[None])
    azimuth = np.arctan2(first @ over[0], first @ right[0])
    lean = np.arccos(np.clip(first @ ahead, -1, 1))
    bend = np.arcsin(np.clip(last[1], -1, 1)) - np.arcsin(np.clip(first[1], -1, 1))
    scale = _length(skeleton, side.nodes) / max(_length(skeleton, bearer.nodes), 1e-9)
    return float(lean), float(azimuth), float(bend), float(scale)


def _length(skeleton: Skeleton, nodes: NDArray[np.int64]) -> float:
    return float(np.linalg.norm(np.diff(skeleton.position[nodes], axis=0), axis=1).sum())


def _spread(values: NDArray[np.float64], usual: Spread) -> Spread:
    """Median and robust deviation of measured values (K,), within what any tree has."""
    middle = float(np.clip(np.median(values), usual.low, usual.high))
    deviation = 1.48 * float(np.median(np.abs(values - np.median(values))))
    return Spread(middle, min(deviation, (usual.high - usual.low) / 4), usual.low, usual.high)


def _circular(angles: NDArray[np.float64], usual: Spread) -> Spread:
    """Mean direction and deviation of angles (K,) on the circle; the usual where they say nothing."""
    if len(angles) < FEWEST:
        return usual
    mean = np.exp(1j * angles).mean()
    if abs(mean) < 0.3:
        return usual
    return Spread(float(np.angle(mean) % (2 * np.pi)), float(np.sqrt(-2 * np.log(abs(mean)))), -np.inf, np.inf)


@dataclass(frozen=True, eq=False)
class Sites:
    """Where units are grafted. S branches."""

    node: NDArray[np.int64]  # (S,) of the skeleton
    ahead: NDArray[np.float64]  # (S, 3) unit direction of the bearer there
    azimuth: NDArray[np.float64]  # (S,) about the bearer
    lean: NDArray[np.float64]  # (S,)
    length: NDArray[np.float64]  # (S,) m

    def __len__(self) -> int:
        return len(self.node)

    def take(self, pick: NDArray[np.int64]) -> Sites:
        return Sites(self.node[pick], self.ahead[pick], self.azimuth[pick], self.lean[pick], self.length[pick])


def no_sites() -> Sites:
    return Sites(np.empty(0, np.int64), np.empty((0, 3)), np.empty(0), np.empty(0), np.empty(0))


def joined(parts: Sequence[Sites]) -> Sites:
    """The sites of all parts; there is at least one."""
    return Sites(*(np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])))


def l_units(
    node: NDArray[np.int64],
    ahead: NDArray[np.float64],
    before: NDArray[np.float64],
    length: NDArray[np.float64],
    form: UnitForm,
    *,
    rng: np.random.Generator,
) -> Sites:
    """One branch at each node (S,) of bearers (S,) m long, turned on from the azimuths `before` (S,)."""
    n = len(node)
    azimuth = before + form.turn.draw(n, rng=rng)
    return Sites(node, ahead, azimuth, form.lean.draw(n, rng=rng), length * form.scale.draw(n, rng=rng))


def y_units(
    node: NDArray[np.int64],
    ahead: NDArray[np.float64],
    length: NDArray[np.float64],
    form: UnitForm,
    *,
    rng: np.random.Generator,
) -> Sites:
    """Two branches at each tip (S,) of bearers (S,) m long; the angle between them is an L unit's lean."""
    node, ahead, length = np.repeat(node, 2), np.repeat(ahead, 2, axis=0), np.repeat(length, 2)
    n = len(node)
    azimuth = np.repeat(rng.uniform(0, 2 * np.pi, n // 2), 2) + np.tile([0.0, np.pi], n // 2)
    return Sites(node, ahead, azimuth, form.lean.draw(n, rng=rng) / 2, length * form.scale.draw(n, rng=rng))


@dataclass(frozen=True, eq=False)
class Grafts:
    """Branches that were grafted. G branches; those that did not grow are not among them."""

    node: NDArray[np.int64]  # (G, NODES) of the skeleton, -1 beyond the branch's end
    ahead: NDArray[np.float64]  # (G, NODES, 3) unit direction in which each node was reached
    azimuth: NDArray[np.float64]  # (G,) about the bearer
    length: NDArray[np.float64]  # (G,) m, as grown


def graft(
    skeleton: Skeleton, sites: Sites, form: UnitForm, volume: CrownVolume | None, *, rng: np.random.Generator
) -> tuple[Skeleton, Grafts]:
    """The skeleton with branches grown at the sites, each as far as the crown reaches; new radii are NaN."""
    s = len(sites)
    right, over = across(sites.ahead)
    outward = np.cos(sites.azimuth)[:, None] * right + np.sin(sites.azimuth)[:, None] * over
    heading = unit(np.cos(sites.lean)[:, None] * sites.ahead + np.sin(sites.lean)[:, None] * outward)
    bend = form.bend.draw(s, rng=rng) / (NODES - 1)
    step, place = sites.length / NODES, skeleton.position[sites.node]
    path, ahead = np.empty((s, NODES, 3)), np.empty((s, NODES, 3))
    grows, ends = np.ones(s, bool), np.zeros(s, np.int64)
    for k in range(NODES):
        tip = place + step[:, None] * heading
        may_end = grows
        if volume is not None:
            may_pass, may_end = volume.allows(tip)
            grows = grows & may_pass & ~volume.is_skin(tip) & volume.spans(place, tip)
        ends = np.where(grows & may_end, k + 1, ends)
        path[:, k], ahead[:, k], place = tip, heading, tip
        heading = bent_upward(heading, bend)
    kept = np.arange(NODES) < ends[:, None]
    node = np.where(kept, len(skeleton) - 1 + np.cumsum(kept.ravel()).reshape(kept.shape), -1)
    above = np.column_stack([sites.node, node[:, :-1]])
    grown = Skeleton(
        np.concatenate([skeleton.position, path[kept]]),
        np.concatenate([skeleton.parent, above[kept]]),
        np.concatenate([skeleton.radius, np.full(int(kept.sum()), np.nan)]),
    )
    alive = ends > 0
    return grown, Grafts(node[alive], ahead[alive], sites.azimuth[alive], (step * ends)[alive])


def bent_upward(heading: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit headings (S, 3) turned by angles (S,) toward the zenith, no farther; downward where they are negative."""
    level = np.hypot(heading[:, 0], heading[:, 2])
    rise = np.clip(np.arctan2(heading[:, 1], level) + angle, -np.pi / 2, np.pi / 2)
    flat = heading[:, [0, 2]] / np.maximum(level, 1e-12)[:, None]
    turned = np.column_stack([flat[:, 0] * np.cos(rise), np.sin(rise), flat[:, 1] * np.cos(rise)])
    return np.where((level > 1e-9)[:, None], turned, heading)
