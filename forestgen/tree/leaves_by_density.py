"""LeavesByDensity: as many leaves in each voxel as it is dense (Neubert et al. 2007, sec. 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.tree.compound_leaves import palmate, pinnate
from forestgen.tree.density import DensityVolume
from forestgen.tree.density_views import estimate_density
from forestgen.tree.foliage import FAR, SHRINK, LeavesAlongBranches
from forestgen.tree.foliage_crown import Crown
from forestgen.tree.foliage_fill import Feet, spread_points
from forestgen.tree.foliage_fit import Placement, join
from forestgen.tree.foliage_poses import light_normals, quaternions, unit
from forestgen.tree.foliage_twigs import YoungWood, young_wood
from forestgen.tree.model import Atlas, Leaves
from forestgen.tree.skeleton import Skeleton, n_children
from forestgen.tree.view import View

STATION = 0.25  # of a leaf's length, between the places on twigs where one may be attached
CHOICE = 4  # nearest such places, of which a leaf takes one: no tufts
TOWARD = 0.5  # of a leaf's length: how far off a point must lie for the leaf to point straight at it
JITTER = 0.3  # of a unit vector


@dataclass(frozen=True, kw_only=True)
class LeavesByDensity(LeavesAlongBranches):
    """Leaves in proportion to the voxels' density, each on the twig nearest to its place.

    "Therefore we refine the leaf arrangement by projecting the position of each leaf to the image
    planes and discarding leaves that are projected to empty or very sparse regions." Sizes, poses,
    colours and the leaves aimed at what is open still are those of leaves along branches.
    """

    density_resolution: int = 64  # voxels along the tree's longest side; sec. 5: 25
    compound: Literal["none", "pinnate", "palmate"] = "none"  # sec. 9.1: "simple leaves arranged on a small twig"
    leaflets: int = 7  # of a compound leaf; ours
    leaflet: float = 0.75  # length of a leaflet over that of a simple leaf; ours
    rachis: float = 0.03  # of the height: part of a twig's end that bears the leaflets in pairs; ours

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.leaflets >= 1 and self.leaflet > 0 and self.rachis > 0):
            raise ValueError("leaflets must be at least 1, and leaflet and rachis positive")

    def __call__(self, skeleton: Skeleton, views: Sequence[View], atlas: Atlas, *, rng: np.random.Generator) -> Leaves:
        """Place the leaves.

        Raises:
            StageError: no voxel is tree in every view.
        """
        leafy = [view for view in views if not view.mattes.is_bare]
        wood = young_wood(skeleton)
        if not leafy or not atlas.prototypes or not len(wood):
            return Leaves(np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.int64))
        crown = Crown(leafy, skeleton, atlas, self.length(skeleton, leafy))
        density = estimate_density(views, resolution=self.density_resolution)
        number = int(self.number(wood, crown))
        kept = []
        if self.compound != "none":
            kept.append(self.on_twig_ends(skeleton, density, number, crown, rng=rng))
            number = max(0, number - len(kept[0]))
        kept.append(self.in_voxels(density.sample(number, rng=rng), wood, crown, rng=rng))
        feet = [Feet.of(wood, target, crown.length) for target in crown.targets]
        for _ in range(self.fill_rounds):
            kept.append(self.fill(feet, crown, self.most - sum(len(part) for part in kept), rng=rng))
        leaves = self.recolour(join(kept), crown, rng=rng)
        return Leaves(leaves.position, quaternions(leaves.rotation), leaves.size, leaves.prototype)

    def in_voxels(
        self, place: NDArray[np.float64], wood: YoungWood, crown: Crown, *, rng: np.random.Generator
    ) -> Placement:
        """Leaves whose blades reach places (N, 3) from twigs near them, where every view shows foliage."""
        foot, axis, way = attached(place, wood, crown.length, crown.reach, self.droop, rng=rng)
        is_far = (way > FAR * crown.length) & crown.is_long.any()
        usual = crown.length * self.factors(len(foot), rng=rng)
        size = np.where(way > FAR * crown.length, crown.reaching(way, is_far), usual)
        kept: list[Placement] = []
        for shrink in SHRINK[: self.tries]:
            normal = light_normals(axis, crown.outside(foot), self.light_spread, rng=rng)
            leaves = self.dress(foot, axis, normal, shrink * size, is_far, crown, rng=rng)
            fits = crown.keep(leaves, self.inside, room=self.most - sum(len(part) for part in kept))
            kept.append(leaves.take(fits))
            foot, axis, size, is_far = foot[~fits], axis[~fits], size[~fits], is_far[~fits]
            axis = unit(axis + rng.normal(0, JITTER, axis.shape))
        return join(kept)

    def on_twig_ends(
        self, skeleton: Skeleton, density: DensityVolume, number: int, crown: Crown, *, rng: np.random.Generator
    ) -> Placement:
        """Compound leaves on twig ends, at most `number` leaflets; those over foliage in every view stay."""
        tips = np.flatnonzero(n_children(skeleton.parent) == 0)
        tips = by_density(tips[tips > 0], skeleton, density, number // self.leaflets, rng=rng)
        if self.compound == "pinnate":
            tall = float(np.ptp(skeleton.position[:, 1]))
            found = pinnate(skeleton, tips, self.leaflets, self.rachis * tall, rng=rng)
        else:
            found = palmate(skeleton, tips, self.leaflets, rng=rng)
        normal = light_normals(found.axis, crown.outside(found.foot) + 4 * found.face, 0.3, rng=rng)
        size = self.leaflet * crown.length * found.share * self.factors(len(found), rng=rng)
        near = np.zeros(len(found), bool)
        leaves = self.dress(found.foot, found.axis, normal, size, near, crown, rng=rng)
        return leaves.take(crown.keep(leaves, self.inside))


def attached(
    place: NDArray[np.float64],
    wood: YoungWood,
    length: float,
    reach: float,
    droop: float,
    *,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Feet (L, 3) on twigs, unit axes (L, 3) and ways (L,), metres, of leaves for those places (N, 3) in reach."""
    station, radius = spread_points(wood, STATION * length)
    k = min(CHOICE, len(station))
    away, near = (found.reshape(len(place), k) for found in cKDTree(station).query(place, k=k))
    score = np.where(away <= reach, rng.random(away.shape), np.inf)
    best = score.argmin(axis=1)[:, None]
    way, chosen = (np.take_along_axis(found, best, axis=1)[:, 0] for found in (away, near))
    fine = way <= reach
    way, chosen = way[fine], chosen[fine]
    toward = place[fine] - station[chosen]
    axis = unit(toward) * np.minimum(1, way / (TOWARD * length))[:, None] + rng.normal(0, JITTER, toward.shape)
    axis[:, 1] -= droop * rng.uniform(0.5, 1.5, len(axis))
    axis = unit(axis)
    return station[chosen] + 0.9 * radius[chosen][:, None] * axis, axis, way


def by_density(
    tips: NDArray[np.int64], skeleton: Skeleton, density: DensityVolume, count: int, *, rng: np.random.Generator
) -> NDArray[np.int64]:
    """At most `count` of the tips (T,), as many in each voxel as it is dense; those in empty voxels last."""
    if count >= len(tips):
        return tips
    place = skeleton.position[tips]
    cell = np.floor((place - density.low) / density.edge).astype(np.int64)
    _, which, crowd = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    weight = density.at(place) / crowd[which.ravel()]
    key = rng.exponential(1.0, len(tips)) / np.maximum(weight, 1e-9)  # the least keys are a weighted draw
    return np.sort(tips[np.argsort(key, kind="stable")[:count]])
