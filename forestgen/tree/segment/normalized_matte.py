"""NormalizedMatte: a trimap from strokes and colours, then normalized matting (Kim & Jeong 2014, sec. II.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from forestgen.errors import StageError
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.segment.matte_pyramid import normalized_alpha
from forestgen.tree.segment.matted import matted
from forestgen.tree.segment.region import dilations_px
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
        return matted(
            photo,
            strokes,
            self.solve,
            components=self.components,
            dilations=self.dilations,
            band=self.band,
            bare=self.bare,
            open_sky=self.open_sky,
            rng=rng,
        )

    def solve(
        self, rgb: NDArray[np.float32], trimap: NDArray[np.float64], nearby: NDArray[np.float32]
    ) -> NDArray[np.float64]:
        """Alpha (h, w) of a picture (h, w, 3) in [0, 1] by the criterion."""
        alpha, _ = normalized_alpha(
            rgb,
            trimap,
            radius=self.radius,
            epsilon=self.epsilon,
            tolerance=self.tolerance,
            most_steps=self.most_steps,
            nearby=nearby,
            pull=self.pull,
        )
        return alpha


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
