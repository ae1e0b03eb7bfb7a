"""What leaves are held against: each view's foliage and colours, and how far the atlas's leaves reach."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.common_light import in_common_light
from forestgen.tree.foliage_colour import colours_at, facing, foliage_colours, prototype_lab
from forestgen.tree.foliage_fit import Placement, blade_samples, cover, footprint, make_target
from forestgen.tree.foliage_unseen import CONTRAST, drift, light, seen_share
from forestgen.tree.model import Atlas, LeafPrototype
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View

SMALLEST, LARGEST, LARGEST_LONG = 0.5, 1.3, 2.0  # an aimed leaf's length over the usual one
LONGER = 0.1  # how much farther along the leaf a long-stalked one's blade lies, of its length
COLOUR_SCALE = 0.35  # blur of the photo's colour over the length of a leaf
CLEARER = 2.0  # power of the share of a leaf that a photo shows: how much more a photo weighs that shows more
FEWEST_SAMPLES, MOST_SAMPLES = 24, 96  # points a leaf is looked up at: about one a pixel


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
        self.colours = [
            foliage_colours(view, pure, COLOUR_SCALE * length * view.camera.px_per_metre)
            for view, pure in zip(views, in_common_light(views), strict=True)
        ]
        self.lab = prototype_lab(atlas)
        finest = max(view.camera.px_per_metre for view in views) * length
        along = np.array([blade_middle(leaf) for leaf in atlas.prototypes])
        halfway = (along.min() + along.max()) / 2
        self.is_long = (along > halfway) & (np.ptp(along) > LONGER)  # (P,)
        self.aim = (
            float(np.median(along[~self.is_long])),
            float(along[self.is_long].mean()) if self.is_long.any() else 1,
        )
        self.samples = blade_samples(atlas, int(np.clip(0.5 * finest**2, FEWEST_SAMPLES, MOST_SAMPLES)))
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

    def fits(self, leaves: Placement, inside: float) -> NDArray[np.bool_]:
        """Which leaves (L,) lie inside every view's foliage."""
        prints = [footprint(target, leaves, self.samples) for target in self.targets]
        return np.asarray(np.all([p.inside >= inside for p in prints], axis=0))

    def seen_shares(self, leaves: Placement) -> NDArray[np.float64]:
        """How much of each leaf each photo would show, in front of the others (V, L)."""
        middle = leaves.position + 0.5 * leaves.size[:, None] * leaves.rotation[:, :, 1]
        return np.stack(
            [
                seen_share(
                    footprint(target, leaves, self.samples).pixel,
                    target.view.camera.depth(middle),
                    target.is_foliage.size,
                )
                for target in self.targets
            ]
        )

    def seen_colours(self, points: NDArray[np.float64], seen: NDArray[np.float64]) -> NDArray[np.float64]:
        """CIELAB (L, 3) for leaves at points (L, 3), the mean of the photos that show some share of each (V, L)."""
        return colours_at(self.views, self.colours, points, seen**CLEARER)

    def unseen_colours(
        self,
        points: NDArray[np.float64],
        area: NDArray[np.float64],
        hidden: NDArray[np.int64],
        *,
        rng: np.random.Generator,
    ) -> NDArray[np.float64]:
        """CIELAB (H, 3) for the hidden ones of leaves at points (L, 3) with some area (L,): clumps, and light."""
        extent = float(np.ptp(points, axis=0).max()) or 1.0
        place = points[hidden] + drift(points[hidden], extent, rng=rng)
        wish = colours_at(self.views, self.colours, place, facing(self.views, self.outside(points[hidden])))
        wish[:, 0] += CONTRAST * float(np.std(wish[:, 0])) * light(points, area, extent)[hidden]
        return wish
