"""Leaves along young branches, kept where the photos show foliage, until that foliage is covered."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.foliage_colour import colours_at, facing, nearest_prototype
from forestgen.tree.foliage_crown import Crown
from forestgen.tree.foliage_fill import Feet, aim_at_open
from forestgen.tree.foliage_fit import Placement, join
from forestgen.tree.foliage_poses import frames, leaf_axes, light_normals, quaternions
from forestgen.tree.foliage_twigs import Stations, YoungWood, place_stations, spread_from_above, young_wood
from forestgen.tree.foliage_unseen import SEEN
from forestgen.tree.leaf_scale import leaf_length
from forestgen.tree.model import Atlas, Leaves
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import Strategy
from forestgen.tree.view import View

log = logging.getLogger(__name__)

SHRINK = (1.0, 0.8, 0.6)  # a leaf that does not fit is tried again this much smaller, standing otherwise
SHOWN = 0.3  # mean projected area of a leaf over its length squared: half as wide as long, in all attitudes
USUAL = 1.5  # of the ground over the photo that a crown covers: its layers of leaves serve both
WIDEST = 2.0  # times as many leaves, at most, for one that spreads wider
MORE = 1.5  # times the leaves, at most, of a crown that has few
FAR = 0.75  # lengths of a leaf: foliage farther from its twig takes a long-stalked leaf
LEAST_GAIN = 0.25  # share of an aimed leaf that must cover open foliage
HIDE_ROUNDS = 4  # at most, of leaves aimed at grown wood that shows where the photo shows none
LEAST_HIDDEN = 0.08  # or, of one that is to hide wood, something open


@dataclass(frozen=True, kw_only=True)
class LeavesAlongBranches(Strategy):
    """Leaves attached by petioles to young wood, each with the colour of its place (Tan et al. 2008, sec. 4).

    The paper's leaf of 1/10 of the trunk's radius is too large to draw a lacy crown and too small to
    clothe a thick-stemmed one; ours is as long as the matte's own detail asks, and leaves are added
    until the foliage is covered.
    """

    size_rule: Literal["matte", "trunk"] = "matte"  # ours; "trunk": sec. 4, a share of the trunk's radius
    trunk_share: float = 0.1  # sec. 4: "1/10 of the main trunk radius"
    size: float = 1.0  # ours: factor on the length that the rule gives
    size_spread: float = 0.18  # ours: relative standard deviation of the length
    number_rule: Literal["cover", "branch"] = "cover"  # ours; "branch": sec. 4, in proportion to a branch's length
    layers: float = 6.0  # ours: how many times the leaves would cover the foliage, laid side by side
    spacing: float = 0.5  # ours: and at least one leaf on so many lengths of a leaf of young wood
    fewest_per_branch: int = 50  # sec. 4
    most_per_branch: int = 200  # sec. 4
    few: int = 15_000  # ours: so few leaves leave holes; up to half as many again close them, and cost little
    most: int = 300_000  # ours: no tree bears more leaves
    tries: int = 3  # ours, 1 to 3: how often a leaf that does not fit is tried again, smaller; sec. 4: once
    fill_rounds: int = 9  # ours: how often leaves are aimed at foliage that is open still
    inside: float = 0.88  # sec. 4 keeps leaves "inside the foliage region"; the share of a leaf that must be
    divergence_deg: float = 137.5  # golden angle between successive leaves; 90 with two per node: opposite
    divergence_spread_deg: float = 17.0  # ours; sec. 4: "randomized", 360
    per_node: int = 1  # leaves at one node; 2: opposite, 3: whorled
    insertion_deg: float = 55.0  # angle between twig and leaf
    droop: float = 0.25  # how much gravity bends the leaf down, as a share of its direction
    light_spread: float = 0.7  # how unevenly faces turn to the light, 0: all alike
    colour_spread: float = 2.0  # CIELAB by which another prototype than the nearest may be taken

    def __post_init__(self) -> None:
        least = {
            "size": 1e-3,
            "trunk_share": 1e-6,
            "spacing": 0.01,
            "tries": 1,
            "per_node": 1,
            "fill_rounds": 0,
            "few": 0,
            "most": 0,
        }
        for name, low in least.items():
            if not getattr(self, name) >= low:
                raise ValueError(f"{name} is {getattr(self, name)}; expected at least {low}")
        if not 0 <= self.inside <= 1:
            raise ValueError(f"inside is {self.inside}; expected a share between 0 and 1")
        if not 0 <= self.fewest_per_branch <= self.most_per_branch:
            raise ValueError(f"fewest_per_branch is {self.fewest_per_branch}; expected 0 to most_per_branch")

    def __call__(self, skeleton: Skeleton, views: Sequence[View], atlas: Atlas, *, rng: np.random.Generator) -> Leaves:
        leafy = [view for view in views if not view.mattes.is_bare]
        wood = young_wood(skeleton)
        if not leafy or not atlas.prototypes or not len(wood):
            return Leaves(np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.int64))
        length = self.length(skeleton, leafy)
        crown = Crown(leafy, skeleton, atlas, length)
        stations = place_stations(
            wood,
            self.number(wood, crown),
            np.deg2rad(self.divergence_deg),
            self.per_node,
            np.deg2rad(self.divergence_spread_deg),
            rng=rng,
        )
        kept = [self.grow(stations, crown, rng=rng)]
        feet = [Feet.of(wood, target, crown.length) for target in crown.targets]
        for _ in range(self.fill_rounds):
            kept.append(self.fill(feet, crown, self.most - sum(len(part) for part in kept), rng=rng))
        for _ in range(min(self.fill_rounds, HIDE_ROUNDS)):
            room = self.most - sum(len(part) for part in kept)
            kept.append(self.fill(feet, crown, room, wood_only=True, rng=rng))
        leaves = self.recolour(join(kept), crown, rng=rng)
        for target in crown.targets:
            share = np.count_nonzero(target.open) / np.count_nonzero(target.is_foliage)
            log.info("leaves: %d of %.3f m; %.1f %% of the foliage is open", len(leaves), length, 100 * share)
        return Leaves(leaves.position, quaternions(leaves.rotation), leaves.size, leaves.prototype)

    def length(self, skeleton: Skeleton, views: Sequence[View]) -> float:
        """How long leaves are on average, metres."""
        if self.size_rule == "trunk":
            return self.size * self.trunk_share * float(np.nanmax(skeleton.radius))
        return self.size * leaf_length(views)

    def number(self, wood: YoungWood, crown: Crown) -> float:
        """How many leaves are tried along the branches."""
        if self.number_rule == "branch":
            _, of = np.unique(wood.branch, return_inverse=True)
            long = np.bincount(of, wood.length)
            n = np.clip(self.most_per_branch * long / long.max(), self.fewest_per_branch, self.most_per_branch).sum()
        else:
            spread = spread_from_above(wood, [view.camera for view in crown.views], 2 * crown.length)
            n = (
                self.layers
                * float(np.clip(spread / USUAL, 1.0, WIDEST))
                * crown.foliage_area
                / (SHOWN * crown.length**2)
            )
            n = max(n, float(wood.length.sum()) / (self.spacing * crown.length))
            n = max(n, min(MORE * n, self.few))
        return float(min(n, self.most))

    def grow(self, stations: Stations, crown: Crown, *, rng: np.random.Generator) -> Placement:
        """The stations' leaves that fit into the photos' foliage, as they are or smaller and turned."""
        kept, rest = [], np.arange(len(stations))
        for shrink in SHRINK[: self.tries]:
            here = Stations(stations.position[rest], stations.twig[rest], stations.outward[rest])
            axis = leaf_axes(here, np.deg2rad(self.insertion_deg), self.droop, 0.2, rng=rng)
            outside = crown.outside(here.position)
            normal = light_normals(axis, outside + 0.3 * here.outward, self.light_spread, rng=rng)
            size = shrink * crown.length * self.factors(len(here), rng=rng)
            leaves = self.dress(here.position, axis, normal, size, np.zeros(len(here), bool), crown, rng=rng)
            fits = crown.keep(leaves, self.inside)
            kept.append(leaves.take(fits))
            rest = rest[~fits]
        return join(kept)

    def fill(
        self, feet: Sequence[Feet], crown: Crown, room: int, *, wood_only: bool = False, rng: np.random.Generator
    ) -> Placement:
        """Leaves aimed at foliage that is open still, from twigs within reach: long-stalked where that is far."""
        kept: list[Placement] = []
        least_gain = LEAST_HIDDEN if wood_only else LEAST_GAIN
        for target, own in zip(crown.targets, feet, strict=True):
            aim = aim_at_open(target, own, crown.length, crown.reach, wood_only=wood_only, rng=rng)
            is_far = (aim.way > FAR * crown.length) & crown.is_long.any()
            size = crown.reaching(aim.way, is_far)
            for shrink in SHRINK[: self.tries]:
                leaves = self.dress(aim.foot, aim.axis, aim.normal, shrink * size, is_far, crown, rng=rng)
                fits = crown.keep(leaves, self.inside, least_gain, room - sum(len(part) for part in kept))
                kept.append(leaves.take(fits))
                aim, is_far, size = aim.take(~fits), is_far[~fits], size[~fits]
        return join(kept)

    def recolour(self, leaves: Placement, crown: Crown, *, rng: np.random.Generator) -> Placement:
        """The same leaves in the colours of the photos that show them, now that it is known which do.

        Those that no photo shows take colours from elsewhere in the crown, by their light.
        """
        seen = crown.seen_shares(leaves)
        is_hidden = seen.max(axis=0) < SEEN
        changed = np.flatnonzero(is_hidden | (len(crown.views) > 1))  # one photo's leaves have its colours already
        if not len(changed):
            return leaves
        middle = leaves.position + 0.6 * leaves.size[:, None] * leaves.rotation[:, :, 1]
        wish = np.empty((len(leaves), 3))
        wish[~is_hidden] = crown.seen_colours(middle[~is_hidden], seen[:, ~is_hidden])
        wish[is_hidden] = crown.unseen_colours(middle, leaves.size**2, np.flatnonzero(is_hidden), rng=rng)
        among = crown.is_long[leaves.prototype[changed]][:, None] == crown.is_long
        prototype = leaves.prototype.copy()
        prototype[changed] = nearest_prototype(wish[changed], crown.lab, among, self.colour_spread, rng=rng)
        other = Placement(leaves.position, leaves.rotation, leaves.size, prototype)
        fits = crown.fits(other.take(changed), self.inside)
        prototype[changed[~fits]] = leaves.prototype[changed[~fits]]
        return other

    def dress(
        self,
        position: NDArray[np.float64],
        axis: NDArray[np.float64],
        normal: NDArray[np.float64],
        size: NDArray[np.float64],
        is_far: NDArray[np.bool_],
        crown: Crown,
        *,
        rng: np.random.Generator,
    ) -> Placement:
        """Leaves with the prototypes that fit their places in the photos; long-stalked where they reach far."""
        middle = position + 0.6 * size[:, None] * axis
        wish = colours_at(crown.views, crown.colours, middle, facing(crown.views, crown.outside(middle)))
        among = is_far[:, None] == crown.is_long
        prototype = nearest_prototype(wish, crown.lab, among, self.colour_spread, rng=rng)
        return Placement(position, frames(axis, normal), size, prototype)

    def factors(self, n: int, *, rng: np.random.Generator) -> NDArray[np.float64]:
        """Relative lengths (n,) of leaves around 1."""
        return np.asarray(np.clip(rng.normal(1.0, self.size_spread, n), 0.5, 1.5))
