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
from forestgen.tree.segment.density_paint import paint
from forestgen.tree.segment.green_red import green_or_red_clusters
from forestgen.tree.segment.min_cut import min_cut
from forestgen.tree.segment.region import Region, look_at
from forestgen.tree.segment.smoothness import edge_costs
from forestgen.tree.segment.soft_edge import soften
from forestgen.tree.segment.wood import find_wood, follow_limbs, share_out
from forestgen.tree.strategy import Strategy
from forestgen.tree.strokes import Strokes

CLIP = 8.0  # nats: what one pixel's colour can say at most under the contrast rule


@dataclass(frozen=True, kw_only=True)
class GraphCutFoliage(Strategy):
    """Foliage by a Gibbs energy over the crown's pixels, wood by the rule that all segmenters share."""

    rule: Literal["contrast", "green_red"] = "contrast"  # paper, sec. 2: "green_red"; benchmarks/segmentation.py
    components: int = 10  # Gaussians for the crown's colours; sec. 2
    leaf_components: int = 4  # of them leaves, under the rule green_red; sec. 2
    smoothness: float = 2.0  # lambda; sec. 2 prints 60, which swallows twigs and gaps: see benchmarks/segmentation.py
    guard: float = (
        8.0  # levels of 255; the paper's lambda/|dI| is infinite at equal colours, differences below count so
    )
    dilations: int = 10  # px by which the crown is widened, for a 1500 px photo; sec. 2 prints 10 for any size
    bare: Literal["auto", "yes", "no"] = "auto"  # whether the crown is twigs alone; not in the paper

    def __call__(self, photo: Photo, strokes: Strokes, *, rng: np.random.Generator) -> Mattes:
        """Both mattes of the tree.

        Raises:
            StageError: neither leaf nor branch pixels are found, or no background to compare with.
        """
        region = look_at(photo.rgb, strokes, self.dilations)
        limbs = follow_limbs(region, strokes, rng=rng)
        evidence = self.weigh(region, rng=rng)
        is_tree = self.cut(region, evidence.log_ratio)
        if self.bare == "yes" or (self.bare == "auto" and is_bare_crown(region, is_tree, limbs.cover)):
            is_wood, is_leaf = is_tree | (limbs.cover >= 0.5), np.zeros_like(is_tree)
        else:
            is_wood = find_wood(region, is_tree, evidence.log_background, limbs, rng=rng)
            is_leaf = is_tree & ~is_wood
        alpha = np.where(region.is_inside | ~limbs.is_near, soften(region.rgb, is_leaf | is_wood), limbs.cover)
        leaf, wood = share_out(alpha, is_leaf, is_wood)
        foliage = paint(region.full(leaf, photo.size), strokes.density)
        branch = np.minimum(region.full(wood, photo.size), 1 - foliage)
        mattes = Mattes(foliage, branch)
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
        says = np.clip(log_ratio, -CLIP, CLIP)
        costs = edge_costs(region.rgb, self.smoothness, self.guard)
        return min_cut(np.maximum(-says, 0), np.maximum(says, 0), *costs) & region.is_inside
