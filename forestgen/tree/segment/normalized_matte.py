"""NormalizedMatte: a trimap from strokes and colours, then normalized matting (Kim & Jeong 2014, sec. II.1)."""

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
from forestgen.tree.segment.matte_pyramid import normalized_alpha
from forestgen.tree.segment.open_sky import without_sky
from forestgen.tree.segment.region import Region, dilations_px, look_at
from forestgen.tree.segment.soft_edge import FLECK, soften, without_flecks
from forestgen.tree.segment.trimap import trimap_of
from forestgen.tree.segment.wood import Limbs, find_wood, follow_limbs, share_out
from forestgen.tree.segment.working_size import enlarge, shrink
from forestgen.tree.strategy import Strategy
from forestgen.tree.strokes import Strokes, draw_polyline

CONTRADICTED = 0.5  # share of the branch strokes under background strokes from which the two contradict each other


@dataclass(frozen=True, kw_only=True)
class NormalizedMatte(Strategy):
    """The tree's alpha where its edge is, by the normalized criterion; leaf and wood by the rule all share.

    The paper mattes from scribbles alone. Then the criterion takes every gap between branches that no scribble
    reaches for foreground (benchmarks/normalized_matting.py), since that adds volume at little cost;
    so here the colours commoner in the crown than around it say first what is tree, and what
    is left to matting is what lies near an edge of theirs.
    """

    radius: int = 1  # of the Laplacian's windows: 3x3 (fig. 2)
    epsilon: float = 1e-4  # how far colours may stray from a line in a window; the paper is silent
    band: int = 2  # px on either side of an edge that are unknown; the paper has scribbles alone
    pull: float = 3.0  # towards the share of tree colour nearby; 0 is the paper's criterion
    tolerance: float = 0.02  # residual at which the solver is done: the ratio is right to 4e-4; the paper is silent
    most_steps: int = 1000  # of conjugate gradients; the paper is silent
    components: int = 10  # Gaussians for the crown's colours, as Tan et al. 2008, sec. 2; the paper has none
    dilations: int = 10  # px at 1500 px by which the crown is widened, as Tan et al. 2008, sec. 2; the paper has none
    open_sky: bool = True  # small gaps that are known by what is behind are taken out; none is printed
    bare: Literal["auto", "yes", "no"] = "auto"  # whether the crown is twigs alone, as the paper's trees are

    def __post_init__(self) -> None:
        for name, least in (("radius", 1), ("band", 1), ("most_steps", 1), ("pull", 0.0)):
            if not getattr(self, name) >= least:
                raise ValueError(f"NormalizedMatte.{name} is {getattr(self, name)}; expected at least {least}")
        for name in ("epsilon", "tolerance"):
            if not getattr(self, name) > 0:
                raise ValueError(f"NormalizedMatte.{name} is {getattr(self, name)}; expected more than 0")

    def __call__(self, photo: Photo, strokes: Strokes, *, rng: np.random.Generator) -> Mattes:
        """Both mattes of the tree.

        Raises:
            StageError: strokes contradict each other, neither leaf nor branch pixels are found, or there is
                no background to compare with.
        """
        refuse_contradiction(photo, strokes, self.dilations)
        working, drawn = shrink(photo, strokes)
        region = look_at(working.rgb, drawn, self.dilations)
        limbs = follow_limbs(region, drawn, rng=rng)
        evidence = contrast_inside_and_ring(region, self.components, rng=rng)
        is_tree = (evidence.log_ratio > 0) & region.is_inside & ~region.is_ring
        if self.bare == "yes" or (self.bare == "auto" and is_bare_crown(region, is_tree, limbs.cover)):
            is_wood = is_tree | limbs.is_limb
        else:
            is_wood = find_wood(region, is_tree, evidence.log_background, limbs, rng=rng)
        if not (is_tree | is_wood).any():
            raise StageError(f"{photo.name}: the crown shows neither leaf nor branch: is the outline on the tree?")
        leaf, wood = share_out(self.matte(region, is_tree | is_wood, is_wood, limbs), is_tree & ~is_wood, is_wood)
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
        trimap = trimap_of(is_tree, self.band, sure_tree=limbs.is_clear, sure_background=region.is_ring & ~is_wood)
        alpha, _ = normalized_alpha(
            region.rgb,
            trimap,
            radius=self.radius,
            epsilon=self.epsilon,
            tolerance=self.tolerance,
            most_steps=self.most_steps,
            nearby=soften(region.rgb, is_tree),
            pull=self.pull,
        )
        sure = without_flecks(alpha.astype(np.float32), FLECK * region.size_px**2)
        by_limb = limbs.is_near & ~region.is_inside & (limbs.is_limb | ~is_wood)
        return np.where(by_limb, limbs.cover, sure)


def refuse_contradiction(photo: Photo, strokes: Strokes, dilations: int) -> None:
    """Raise StageError where background strokes cover most of the branch strokes."""
    width = max(3, dilations_px(dilations, photo.size) // 2)
    is_background = np.zeros(photo.rgb.shape[:2], bool)
    for path in strokes.background:
        is_background |= draw_polyline(path, photo.size, width)
    is_branch = np.zeros_like(is_background)
    for path in strokes.branches:
        is_branch |= draw_polyline(path, photo.size)
    share = float(is_background[is_branch].mean()) if is_branch.any() else 0.0
    if share > CONTRADICTED:
        raise StageError(
            f"{photo.name}: {share:.0%} of the 'branches' strokes lie under 'background' strokes; "
            "a pixel cannot be both: draw one of them elsewhere"
        )
