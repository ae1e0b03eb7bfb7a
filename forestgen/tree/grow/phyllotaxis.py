"""PhyllotaxisTwigs: regular small twigs on the main branches (Neubert et al. 2007, sec. 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow.crown_volume import CrownVolume
from forestgen.tree.grow.densify import densify
from forestgen.tree.grow.phyllotaxis_shoots import ShootRules, buds_on, grow_shoots
from forestgen.tree.grow.phyllotaxis_volume import dense_volume
from forestgen.tree.grow.twigs import grow_twigs
from forestgen.tree.grow.whole_crown import VISIBLE_SPACING
from forestgen.tree.radius import trunk_radius
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import OnStep, Strategy
from forestgen.tree.view import View

RACHIS_SPACING = 0.6  # of a compound leaf's length, between two of them on their bearer


@dataclass(frozen=True, kw_only=True)
class PhyllotaxisTwigs(Strategy):
    """Twigs of one or more orders, by divergence angle, plagiotropism, length, rigidity and frequency.

    The paper lets the user choose these; it gives no figures but the angles. Twigs stay where every
    view has foliage and the density volume is filled. What they leave unreached, space colonisation
    reaches (`complete`): regular twigs alone clothe the main branches and not the crown between them.
    """

    divergence_deg: float = 137.5  # sec. 8: "about 137.5 deg"; "other prominent angles are 90, 180"
    per_node: int = 1  # twigs at one node; 2 with a divergence of 90: decussate
    plagiotropism: float = 0.35  # sec. 8: perpendicular to the sunlight, share of the way there; below 0: upright
    length: float = 0.07  # of the height; sec. 8: chosen by the user
    rigidity: float = 0.8  # sec. 8: chosen by the user; 1: twigs do not bend by their own weight
    frequency: float = 40.0  # twigs on wood as long as the tree is tall; sec. 8: chosen by the user
    orders: int = 2  # twigs on twigs; ours
    shorter: float = 0.55  # length of each further order over that of its bearers; ours
    insertion_deg: float = 52.0  # between bearer and twig; ours
    bearer: float = 0.35  # of the stem's radius; thicker wood bears no twigs; ours
    compound: float = 0.0  # of the height: length of compound leaves' own twigs (sec. 9.1), 0: simple leaves
    complete: bool = True  # ours: space colonisation toward foliage without a twig near; the paper: no
    interval: float = 0.028  # of the height, between the points that each want a twig then
    most: int = 20_000  # ours: no order has more twigs
    density_resolution: int = 64  # voxels along the tree's longest side; sec. 5: 25

    def __post_init__(self) -> None:
        least = {"per_node": 1, "length": 1e-4, "frequency": 0, "orders": 0, "shorter": 0.05, "interval": 0.005}
        for name, low in least.items():
            if not getattr(self, name) >= low:
                raise ValueError(f"{name} is {getattr(self, name)}; expected at least {low}")
        if not 0 <= self.rigidity <= 1:
            raise ValueError(f"rigidity is {self.rigidity}; expected 0 to 1")
        if not -1 <= self.plagiotropism <= 1:
            raise ValueError(f"plagiotropism is {self.plagiotropism}; expected -1 to 1")

    @classmethod
    def paper(cls) -> PhyllotaxisTwigs:
        """Regular twigs and nothing else, on the paper's grid."""
        return cls(complete=False, density_resolution=25)

    def __call__(
        self, skeleton: Skeleton, views: Sequence[View], *, rng: np.random.Generator, on_step: OnStep | None = None
    ) -> Skeleton:
        """Grow twigs on the main branches.

        Raises:
            StageError: a view shows no crown, or no place in space is tree in every view.
        """
        volume = dense_volume(views, self.density_resolution)
        grown, _ = densify(skeleton, VISIBLE_SPACING * volume.height)
        n_fixed = len(grown)
        bears = bearing(grown, self.bearer)
        bare = np.flatnonzero(~bears)
        orders = self.rules(volume.height)
        for done, rules in enumerate(orders, 1):
            first = len(grown)
            grown = self.with_shoots(grown, bears, rules, volume, rng=rng)
            bears = np.arange(len(grown)) >= first
            if on_step is not None:
                on_step(done, len(orders), {"twigs": float(len(grown) - first)})
        if self.complete:
            spacing = max(self.interval * volume.height, volume.spacing_for(12_000, rng))
            grown = grow_twigs(grown, n_fixed, bare, volume, spacing, rng=rng)
        return grown

    def rules(self, height: float) -> list[ShootRules]:
        """How the twigs of each order stand and bend on a tree of some height, metres; compound leaves' come last."""
        usual = ShootRules(
            length=self.length * height,
            spacing=height / max(self.frequency, 1e-6),
            divergence=float(np.deg2rad(self.divergence_deg)),
            per_node=self.per_node,
            insertion=float(np.deg2rad(self.insertion_deg)),
            plagiotropism=self.plagiotropism,
            rigidity=self.rigidity,
        )
        found = [replace(usual, length=usual.length * self.shorter**order) for order in range(self.orders)]
        if self.compound > 0:
            long = self.compound * height
            found.append(replace(usual, length=long, spacing=RACHIS_SPACING * long))
        return found

    def with_shoots(
        self,
        skeleton: Skeleton,
        bears: NDArray[np.bool_],
        rules: ShootRules,
        volume: CrownVolume,
        *,
        rng: np.random.Generator,
    ) -> Skeleton:
        """The skeleton with one more order of twigs on the nodes that bear (N,)."""
        buds = buds_on(skeleton, bears, rules, rng=rng)
        if len(buds) > self.most:
            buds = buds.take(np.sort(rng.choice(len(buds), self.most, replace=False)))
        return grow_shoots(skeleton, buds, volume, rules, rng=rng)


def bearing(skeleton: Skeleton, share: float) -> NDArray[np.bool_]:
    """Which nodes (N,) are thin enough for twigs: at most `share` of the stem's radius, or the thinnest there are."""
    known = skeleton.radius[np.isfinite(skeleton.radius)]
    thinnest = float(known.min()) if len(known) else 0.0
    limit = max(share * trunk_radius(skeleton), thinnest)
    return np.asarray(np.nan_to_num(skeleton.radius, nan=0.0) <= limit)
