"""Grafting: L and Y units at tips and sides, level upon level (Kim & Jeong 2014, sec. II.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forestgen.tree.grow.axes import axes_of, stem_end
from forestgen.tree.grow.crown_volume import CrownVolume, crown_volume
from forestgen.tree.grow.densify import densify
from forestgen.tree.grow.grafting_units import (
    NODES,
    Grafts,
    Sites,
    UnitForm,
    estimated_form,
    graft,
    joined,
    l_units,
    no_sites,
    y_units,
)
from forestgen.tree.grow.whole_crown import VISIBLE_SPACING, Spacing, crown_tree, with_twigs
from forestgen.tree.limbs import unit
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import OnStep, Strategy
from forestgen.tree.view import View

SHORT_END, TIPWARD = 0.3, 1.2  # L units at a visible branch's tip are so much shorter, and grow so fast below it
FORK = 0.5  # of a visible branch's length: what the Y unit at its tip is in scale to; a trunk's twigs are no trunks
LEAST = 0.03  # of the height: visible side branches as long as this say what units look like


@dataclass(frozen=True, kw_only=True)
class Grafting(Strategy):
    """Invisible branches from parametric units, by local self-similarity; `paper()` is the printed setting.

    Each visible branch gets a Y unit at its tip and L units along its side; each grafted branch gets
    the same in the next level.
    """

    levels: int = 3  # "branch propagation levels (2-4 level)" (fig. 7)
    interval: float = 0.05  # of the height, between L units on a visible branch; the paper is silent
    sides: int = 2  # L units on a grafted branch; of the four units in fig. 7, two are of this type
    bare_trunk: float = 0.4  # of the drawn trunk, from the ground, bears no unit; the paper is silent
    most: int = 6000  # ours: branches of a level; the paper's trees have up to 25,629 nodes in all (table 2)
    inside_crown: bool = True  # paper: no; units end where the photo's crown does
    complete: bool = True  # paper: no; twigs wherever the crown has no wood near after the last level
    leaf_masses: bool = True  # paper: no; the crown is made of lobes as large and uneven as the outline's
    twig_interval: float = 0.028  # of the height, between the points that each want a twig then
    least_twigs: int = 3000  # points at least: in a small crown they lie closer
    most_twigs: int = 12000  # and at most

    def __post_init__(self) -> None:
        least = {"levels": 0, "interval": 1e-3, "sides": 0, "bare_trunk": 0, "most": 0, "twig_interval": 1e-3}
        for name, low in least.items():
            if not getattr(self, name) >= low:
                raise ValueError(f"{name} is {getattr(self, name)}; expected at least {low}")
        if self.levels > 8:
            raise ValueError(f"levels is {self.levels}; expected at most 8: each has several times the branches")

    @classmethod
    def paper(cls) -> Grafting:
        """Units and nothing else, wherever they reach."""
        return cls(inside_crown=False, complete=False, leaf_masses=False)

    def __call__(
        self, skeleton: Skeleton, views: Sequence[View], *, rng: np.random.Generator, on_step: OnStep | None = None
    ) -> Skeleton:
        """Grow the visible skeleton into the whole tree's.

        Raises:
            StageError: a view shows no crown to grow into.
        """
        tall = float(np.ptp(skeleton.position[:, 1]))
        form = estimated_form(skeleton, stem_end(skeleton, views[0]), LEAST * tall)
        if not (self.inside_crown or self.complete):
            visible, _ = densify(skeleton, VISIBLE_SPACING * max(tall, 1e-6))
            stem = stem_end(visible, views[0])
            return self.grafted(visible, visible, stem, None, form, tall, rng=rng, on_step=on_step)
        volume = crown_volume(views)
        tree, volume, crown = crown_tree(
            skeleton, views[0], volume, has_leader=True, has_masses=self.leaf_masses, rng=rng
        )
        inside = volume if self.inside_crown else None
        stem = int(tree.axes[0].nodes[-1])
        grown = self.grafted(tree.skeleton, tree.skeleton, stem, inside, form, volume.height, rng=rng, on_step=on_step)
        if not self.complete:
            return grown
        spacing = Spacing(interval=self.twig_interval, least=self.least_twigs, most=self.most_twigs)
        return with_twigs(grown, tree, volume, crown, spacing, rng=rng)

    def grafted(
        self,
        grown: Skeleton,
        visible: Skeleton,
        stem: int,
        volume: CrownVolume | None,
        form: UnitForm,
        height: float,
        *,
        rng: np.random.Generator,
        on_step: OnStep | None,
    ) -> Skeleton:
        """The tree with all levels of units; the trunk leads through the node `stem`."""
        sites = visible_sites(visible, stem, self.interval * height, self.bare_trunk, form, rng=rng)
        for level in range(1, self.levels + 1):
            if len(sites) > self.most:
                sites = sites.take(np.sort(rng.choice(len(sites), self.most, replace=False)))
            first = len(grown)
            grown, grafts = graft(grown, sites, form, volume, rng=rng)
            sites = next_sites(grafts, self.sides, form, rng=rng)
            if on_step is not None:
                on_step(level, self.levels, {"grafted": float(len(grown) - first)})
        return grown


def visible_sites(
    skeleton: Skeleton, stem: int, interval: float, bare_trunk: float, form: UnitForm, *, rng: np.random.Generator
) -> Sites:
    """A Y unit at the tip of each visible branch, L units at its side every `interval` metres."""
    found = [no_sites()]
    for axis in axes_of(skeleton, stem):
        step = np.diff(skeleton.position[axis.nodes], axis=0)
        along = np.append(0.0, np.cumsum(np.linalg.norm(step, axis=1)))
        whole = float(along[-1])
        if whole == 0:
            continue
        ahead = unit(np.concatenate([step[:1], step]))
        low = bare_trunk * whole if axis.bearer < 0 else 0.5 * interval
        at = np.unique(np.searchsorted(along, np.arange(low + rng.uniform(0, interval), whole, interval)))
        at = at[(at > 0) & (at < len(along) - 1)]
        before = rng.uniform(0, 2 * np.pi) + form.turn.mean * np.arange(len(at), dtype=np.float64)
        bearer = np.asarray(whole * np.clip(TIPWARD * (1 - along[at] / whole) + SHORT_END, 0, 1), np.float64)
        found.append(l_units(axis.nodes[at], ahead[at], before, bearer, form, rng=rng))
        found.append(y_units(axis.nodes[-1:], ahead[-1:], FORK * along[-1:], form, rng=rng))
    return joined(found)


def next_sites(grafts: Grafts, n_sides: int, form: UnitForm, *, rng: np.random.Generator) -> Sites:
    """A Y unit at the tip of each grafted branch and L units on its inner nodes, as many as it has of them."""
    count, azimuth = (grafts.node >= 0).sum(axis=1), grafts.azimuth.copy()
    last = (np.arange(len(count)), count - 1)
    found = [y_units(grafts.node[last], grafts.ahead[last], grafts.length, form, rng=rng)]
    for k in range(min(n_sides, NODES - 1)):
        has = np.flatnonzero(count > k + 1)
        found.append(
            l_units(grafts.node[has, k], grafts.ahead[has, k], azimuth[has], grafts.length[has], form, rng=rng)
        )
        azimuth[has] = found[-1].azimuth
    return joined(found)
