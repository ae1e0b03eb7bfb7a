"""ClosedFormMatte: a trimap from strokes and colours, then closed-form matting (Neubert et al. 2007, sec. 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.segment.matted import matted
from forestgen.tree.segment.trimap import unknown_alpha
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
        return matted(
            photo,
            strokes,
            lambda rgb, trimap, nearby: unknown_alpha(rgb, trimap, nearby, self.pull, self.epsilon),
            components=self.components,
            dilations=self.dilations,
            band=self.band,
            bare=self.bare,
            open_sky=self.open_sky,
            rng=rng,
        )
