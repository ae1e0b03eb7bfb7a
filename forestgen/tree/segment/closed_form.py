"""ClosedFormMatte: a trimap from strokes and colours, then closed-form matting (Neubert et al. 2007, sec. 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from forestgen.errors import StageError
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.segment.bare import is_bare_crown
from forestgen.tree.segment.contrast import contrast_inside_and_ring
from forestgen.tree.segment.open_sky import without_sky
from forestgen.tree.segment.region import Region, look_at
from forestgen.tree.segment.soft_edge import FLECK, soften, without_flecks
from forestgen.tree.segment.trimap import trimap_of, unknown_alpha
from forestgen.tree.segment.wood import Limbs, find_wood, follow_limbs, share_out
from forestgen.tree.segment.working_size import enlarge, shrink
from forestgen.tree.strategy import Strategy
from forestgen.tree.strokes import Strokes


@dataclass(frozen=True, kw_only=True)
class ClosedFormMatte(Strategy):
    """The tree's density in a photo: soft wherever leaves and sky share a pixel. Wood by the rule all share.

    The paper takes "pixels with appropriate colours" for certain and leaves the rest to any
    trimap matting. Here the colours are those commoner in the crown than around it, and what is
    left to matting is what lies near an edge of theirs.
    """

    components: int = 10  # Gaussians for the crown's colours, as Tan et al. 2008, sec. 2; the paper is silent
    dilations: int = 10  # px at 1500 px by which the crown is widened, as Tan et al. 2008, sec. 2; the paper is silent
    band: int = 2  # px on either side of an edge that are unknown (benchmarks/matting.py); the paper is silent
    pull: float = 3.0  # towards the share of tree colour nearby; 0 is the paper's plain matting: it bridges gaps
    epsilon: float = 1e-4  # of the matting Laplacian: how far colours may stray from a line; the paper is silent
    open_sky: bool = True  # small gaps that are known by what is behind are taken out; none is printed
    bare: Literal["auto", "yes", "no"] = "auto"  # whether the crown is twigs alone; the paper's oak is not told

    def __post_init__(self) -> None:
        for name, least in (("band", 1), ("pull", 0.0), ("epsilon", 0.0)):
            if not getattr(self, name) >= least:
                raise ValueError(f"ClosedFormMatte.{name} is {getattr(self, name)}; expected at least {least}")

    def __call__(self, photo: Photo, strokes: Strokes, *, rng: np.random.Generator) -> Mattes:
        """Both mattes of the tree.

        Raises:
            StageError: neither leaf nor branch pixels are found, or there is no background to compare with.
        """
        working, drawn = shrink(photo, strokes)
        region = look_at(working.rgb, drawn, self.dilations)
        limbs = follow_limbs(region, drawn, rng=rng)
        evidence = contrast_inside_and_ring(region, self.components, rng=rng)
        is_tree = (evidence.log_ratio > 0) & region.is_inside & ~region.is_ring
        if self.bare == "yes" or (self.bare == "auto" and is_bare_crown(region, is_tree, limbs.cover)):
            is_wood = is_tree | limbs.is_limb
        else:
            is_wood = find_wood(region, is_tree, evidence.log_background, limbs, rng=rng)
        alpha = self.matte(region, is_tree | is_wood, is_wood, limbs)
        leaf, wood = share_out(alpha, is_tree & ~is_wood, is_wood)
        if self.open_sky:
            leaf = without_sky(region, leaf, wood)
        mattes = enlarge(Mattes(region.full(leaf, working.size), region.full(wood, working.size)), photo.size)
        if not mattes.is_tree.any():
            raise StageError(f"{photo.name}: the crown shows neither leaf nor branch: is the outline on the tree?")
        return mattes

    def matte(
        self, region: Region, is_tree: NDArray[np.bool_], is_wood: NDArray[np.bool_], limbs: Limbs
    ) -> NDArray[np.float32]:
        """Alpha (h, w) of the tree; below the crown the limbs' own edges."""
        nearby = soften(region.rgb, is_tree)
        trimap = trimap_of(is_tree, self.band, sure_tree=limbs.is_clear, sure_background=region.is_ring & ~is_wood)
        alpha = unknown_alpha(region.rgb, trimap, nearby, self.pull, self.epsilon)
        alpha = without_flecks(alpha, FLECK * region.size_px**2)
        by_limb = limbs.is_near & ~region.is_inside & (limbs.is_limb | ~is_wood)
        return np.where(by_limb, limbs.cover, alpha)
