"""GraphCutFoliage: foliage by colour mixtures and a graph cut (Tan et al. 2008, sec. 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from forestgen.errors import StageError
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.segment.bare import is_bare_crown
from forestgen.tree.segment.contrast import Evidence, contrast_inside_and_ring
from forestgen.tree.segment.green_red import green_or_red_clusters
from forestgen.tree.segment.min_cut import min_cut
from forestgen.tree.segment.neighbours import without_neighbours
from forestgen.tree.segment.open_sky import without_sky
from forestgen.tree.segment.region import Region, bounding, look_at
from forestgen.tree.segment.smoothness import edge_costs
from forestgen.tree.segment.wood import find_wood, follow_limbs, matte
from forestgen.tree.segment.working_size import enlarge, shrink
from forestgen.tree.strategy import Strategy
from forestgen.tree.strokes import Strokes


@dataclass(frozen=True, kw_only=True)
class GraphCutFoliage(Strategy):
    """Foliage by a Gibbs energy over the crown's pixels, wood by the rule that all segmenters share."""

    rule: Literal["contrast", "green_red"] = "contrast"  # sec. 2: "green_red", which fails for blossom and frost
    components: int = 10  # Gaussians for the crown's colours; sec. 2
    leaf_components: int = 4  # how many of them are leaves under the rule green_red; sec. 2
    smoothness: float = 5.0  # lambda; sec. 2 prints 60: it swallows twigs and gaps (benchmarks/segmentation.py)
    guard: float = 8.0  # levels of 255: lambda/|dI| of sec. 2 is infinite at equal colours, less counts as this
    dilations: int = (
        10  # px by which the crown is widened; sec. 2 prints 10, here for 1500 px and scaled with the photo
    )
    bare: Literal["auto", "yes", "no"] = "auto"  # whether the crown is twigs alone; the paper knows no bare tree

    def __call__(self, photo: Photo, strokes: Strokes, *, rng: np.random.Generator) -> Mattes:
        """Both mattes of the tree.

        Raises:
            StageError: neither leaf nor branch pixels are found, or there is no background to compare with.
        """
        working, drawn = shrink(photo, strokes)
        region = look_at(working.rgb, drawn, self.dilations)
        limbs = follow_limbs(region, drawn, rng=rng)
        evidence = self.weigh(region, rng=rng)
        is_tree = self.cut(region, evidence.log_ratio)
        if self.bare == "yes" or (self.bare == "auto" and is_bare_crown(region, is_tree, limbs.cover)):
            is_wood = is_tree | limbs.is_limb
        else:
            as_drawn = self.rule == "green_red"
            is_wood = find_wood(region, is_tree, evidence.log_background, limbs, as_drawn=as_drawn, rng=rng)
            is_tree, is_wood = without_neighbours(region, is_tree, is_wood, limbs)
        leaf, wood = matte(region, is_tree & ~is_wood, is_wood, limbs)
        if self.rule == "contrast":
            leaf = np.where(limbs.is_limb, leaf, without_sky(region, leaf, wood))
        mattes = enlarge(Mattes(region.full(leaf, working.size), region.full(wood, working.size)), photo.size)
        if not mattes.is_tree.any():
            raise StageError(f"{photo.name}: the crown shows neither leaf nor branch: is the outline on the tree?")
        return mattes

    def weigh(self, region: Region, *, rng: np.random.Generator) -> Evidence:
        """What the colours say, by the chosen rule."""
        if self.rule == "green_red":
            return green_or_red_clusters(region, self.components, self.leaf_components, rng=rng)
        return contrast_inside_and_ring(region, self.components, rng=rng)

    def cut(self, region: Region, log_ratio: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Tree pixels (h, w) of least Gibbs energy: data term -log density, smoothness lambda/|dI|."""
        window = bounding(region.is_inside)
        says = log_ratio[window]
        costs = edge_costs(region.rgb[window], self.smoothness, self.guard)
        is_tree = np.zeros_like(region.is_inside)
        is_tree[window] = min_cut(np.maximum(-says, 0), np.maximum(says, 0), *costs)
        return np.asarray(is_tree & region.is_inside)
