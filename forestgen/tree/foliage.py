"""Leaves along young branches, kept where the photos show foliage, until that foliage is covered."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.foliage_colour import colours_at, foliage_colours, nearest_prototype, prototype_lab
from forestgen.tree.foliage_fill import aim_at_open
from forestgen.tree.foliage_fit import Placement, blade_samples, cover, footprint, join, make_target
from forestgen.tree.foliage_poses import frames, leaf_axes, light_normals, quaternions
from forestgen.tree.foliage_twigs import Stations, YoungWood, place_stations, young_wood
from forestgen.tree.leaf_scale import leaf_length
from forestgen.tree.model import Atlas, LeafPrototype, Leaves
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import Strategy
from forestgen.tree.view import View

log = logging.getLogger(__name__)

SHRINK = (1.0, 0.8, 0.6)  # a leaf that does not fit is tried again this much smaller, standing otherwise
SHOWN = 0.3  # mean projected area of a leaf over its length squared: half as wide as long, in all attitudes
FAR = 0.75  # lengths of a leaf: foliage farther from its twig takes a long-stalked leaf
SMALLEST, LARGEST, LARGEST_LONG = 0.5, 1.3, 2.0  # an aimed leaf's length over the usual one
LEAST_GAIN = 0.25  # share of an aimed leaf that must cover open foliage
COLOUR_SCALE = 0.35  # blur of the photo's colour over the length of a leaf


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
    layers: float = 4.0  # ours: how many times the leaves would cover the foliage, laid side by side
    spacing: float = 0.5  # ours: and at least one leaf on so many lengths of a leaf of young wood
    fewest_per_branch: int = 50  # sec. 4
    most_per_branch: int = 200  # sec. 4
    most: int = 300_000  # ours: no tree bears more leaves
    fill_rounds: int = 6  # ours: how often leaves are aimed at foliage that is open still
    inside: float = 0.88  # sec. 4 keeps leaves "inside the foliage region"; the share of a leaf that must be
    divergence_deg: float = 137.5  # golden angle between successive leaves; 90 with two per node: opposite
    per_node: int = 1  # leaves at one node; 2: opposite, 3: whorled
    insertion_deg: float = 55.0  # angle between twig and leaf
    droop: float = 0.25  # how much gravity bends the leaf down, as a share of its direction
    light_spread: float = 0.7  # how unevenly faces turn to the light, 0: all alike
    colour_spread: float = 2.0  # CIELAB by which another prototype than the nearest may be taken

    def __call__(self, skeleton: Skeleton, views: Sequence[View], atlas: Atlas, *, rng: np.random.Generator) -> Leaves:
        leafy = [view for view in views if not view.mattes.is_bare]
        wood = young_wood(skeleton)
        if not leafy or not atlas.prototypes or not len(wood):
            return Leaves(np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.int64))
        length = self.length(skeleton, leafy)
        crown = Crown(leafy, skeleton, atlas, length)
        stations = place_stations(
            wood, self.number(wood, crown), np.deg2rad(self.divergence_deg), self.per_node, 0.3, rng=rng
        )
        kept = [self.grow(stations, crown, rng=rng)]
        for _ in range(self.fill_rounds):
            kept.append(self.fill(wood, crown, self.most - sum(map(len, kept)), rng=rng))
        leaves = join(kept)
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
            n = self.layers * crown.foliage_area / (SHOWN * crown.length**2)
            n = max(n, float(wood.length.sum()) / (self.spacing * crown.length))
        return float(min(n, self.most))

    def grow(self, stations: Stations, crown: Crown, *, rng: np.random.Generator) -> Placement:
        """The stations' leaves that fit into the photos' foliage, as they are or smaller and turned."""
        kept, rest = [], np.arange(len(stations))
        for shrink in SHRINK:
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

    def fill(self, wood: YoungWood, crown: Crown, room: int, *, rng: np.random.Generator) -> Placement:
        """Leaves aimed at foliage that is open still, from twigs within reach: long-stalked where that is far."""
        kept = []
        for target in crown.targets:
            aim = aim_at_open(target, wood, crown.length, crown.reach, rng=rng)
            is_far = (aim.way > FAR * crown.length) & crown.is_long.any()
            size = crown.reaching(aim.way, is_far)
            for shrink in SHRINK:
                leaves = self.dress(aim.foot, aim.axis, aim.normal, shrink * size, is_far, crown, rng=rng)
                fits = crown.keep(leaves, self.inside, LEAST_GAIN, room - sum(map(len, kept)))
                kept.append(leaves.take(fits))
                aim, is_far, size = aim.take(~fits), is_far[~fits], size[~fits]
        return join(kept)

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
        wish = colours_at(crown.views, crown.colours, middle, crown.outside(middle))
        among = is_far[:, None] == crown.is_long
        prototype = nearest_prototype(wish, crown.lab, among, self.colour_spread, rng=rng)
        return Placement(position, frames(axis, normal), size, prototype)

    def factors(self, n: int, *, rng: np.random.Generator) -> NDArray[np.float64]:
        """Relative lengths (n,) of leaves around 1."""
        return np.asarray(np.clip(rng.normal(1.0, self.size_spread, n), 0.5, 1.5))


def blade_middle(leaf: LeafPrototype) -> float:
    """How far along a leaf the middle of its area is, in [0, 1]."""
    corner = leaf.points[leaf.faces]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    return float(np.average(corner[..., 1].mean(axis=1), weights=area))


class Crown:
    """What leaves are held against: each view's foliage and colours, and the atlas."""

    def __init__(self, views: Sequence[View], skeleton: Skeleton, atlas: Atlas, length: float) -> None:
        self.views, self.length = views, length
        self.targets = [make_target(view, skeleton) for view in views]
        self.colours = [foliage_colours(view, COLOUR_SCALE * length * view.camera.px_per_metre) for view in views]
        self.lab = prototype_lab(atlas)
        finest = max(view.camera.px_per_metre for view in views) * length
        self.middle_of = np.array([blade_middle(leaf) for leaf in atlas.prototypes])
        usual = float(self.middle_of.min())
        self.is_long = self.middle_of > usual + 0.1  # (P,)
        if not self.is_long.any() or self.is_long.all():
            self.is_long = np.zeros(len(self.lab), bool)
        self.aim = (usual, float(self.middle_of.max()))
        self.samples = blade_samples(atlas, int(np.clip(0.5 * finest**2, 24, 96)))
        tips = skeleton.position[skeleton.position[:, 1] > 0.3 * skeleton.position[:, 1].max()]
        self.middle = np.median(tips, axis=0) if len(tips) else np.zeros(3)

    @property
    def reach(self) -> float:
        """How far from its twig the middle of a leaf can be, metres."""
        return self.length * (LARGEST_LONG * self.aim[1] if self.is_long.any() else LARGEST * self.aim[0])

    def reaching(self, way: NDArray[np.float64], is_far: NDArray[np.bool_]) -> NDArray[np.float64]:
        """How long leaves (L,) are, metres, whose blades' middles lie `way` metres (L,) from their feet."""
        size = way / np.where(is_far, self.aim[1], self.aim[0]) / self.length
        return np.clip(size, SMALLEST, np.where(is_far, LARGEST_LONG, LARGEST)) * self.length

    @property
    def foliage_area(self) -> float:
        """The largest area of foliage that a view shows, square metres."""
        return max(np.count_nonzero(t.is_foliage) / t.view.camera.px_per_metre**2 for t in self.targets)

    def outside(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Directions (N, 3) from the crown's middle."""
        return np.asarray(points - self.middle)

    def keep(self, leaves: Placement, inside: float, gain: float = 0.0, room: int | None = None) -> NDArray[np.bool_]:
        """Which leaves (L,) lie inside every view's foliage and win some open foliage; what they cover is noted."""
        prints = [footprint(target, leaves, self.samples) for target in self.targets]
        fits = np.all([p.inside >= inside for p in prints], axis=0)
        if gain > 0:
            fits &= np.max([p.gain for p in prints], axis=0) >= gain
        if room is not None:
            fits &= np.cumsum(fits) <= room
        for target, p in zip(self.targets, prints, strict=True):
            cover(target, p.pixel[fits])
        return np.asarray(fits)
