"""Particle flow: biomass flows down to the root along the visible branches of all views, and leaves a skeleton."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.errors import StageError
from forestgen.tree.density import DensityVolume
from forestgen.tree.density_views import estimate_density
from forestgen.tree.lift.direction_field import Blend, DirectionField, direction_field
from forestgen.tree.lift.flow_limbs import limbs_in_space
from forestgen.tree.lift.flow_smoothing import joined_forward, smoothed, straightened, thinned, without_stubs
from forestgen.tree.lift.flow_tracing import FlowRules, Graph, trace_particles
from forestgen.tree.lift.flow_trunk import Limbs, densified
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import Strategy
from forestgen.tree.view import View

FLOOR = 0.015  # of the height: what is lower is at the tree's base
FAR = 2.0  # times the greatest distance from the root: the way that a particle can make in all steps


@dataclass(frozen=True, kw_only=True)
class ParticleFlow(Strategy):
    """Particle tracing of Neubert et al. 2007, sec. 6 and 7, from one or more views.

    With `visible_limbs` (ours) the branches that the views show are put into space first, and the
    particles end on them; without, only the root is known, and the direction fields alone lead.
    """

    particles: int = 1000  # sec. 6: 500 to 1000 for medium-sized trees, 1000 to 2000 for large ones
    steps: int = 200  # sec. 9, "200 iterations"
    field_resolution: int = 100  # sec. 7, "a grid of 100 by 100"
    density_resolution: int = 64  # ours; sec. 5 has 25
    density_prior: bool = True  # ours: a rounded crown; sec. 5 has the views' least alone
    blend: Blend = "linear"  # h(d) of eq. 3; sec. 7, "the mostly used case"
    blend_reach: float = 0.1  # of the height, where a linear h reaches 1; not printed
    blend_share: float = 0.5  # a constant h; not printed
    visible_limbs: bool = True  # ours
    to_field: float = 0.6  # weights of what drives a particle; none is printed
    to_neighbour: float = 0.9
    to_base: float = 0.3
    to_limb: float = 1.0  # ours
    limb_share: float = 0.65  # ours: h for limbs in space, constant: branches leave them at this angle
    inertia: float = 2.0  # steps in which a single particle turns; sec. 6 has a mass without a value
    inertia_growth: float = 0.3  # exponent of the number of joined particles in their mass
    sight: float = 2.5  # of the particles' mean distance: how far they attract
    join: float = 0.35  # of the particles' mean distance: how near they join
    join_traces: bool = True  # ours: also with the trace of one that has passed, so that nothing runs beside it
    least_turn_deg: float = 75.0  # ours: between a particle's way and a trace that it joins
    detour: float = 0.2  # ours, of the height: within that much way nothing may wind; 0 lets it
    shortest: float = 0.025  # of the height: shorter branches fall (chiselled, fig. 5c)
    smoothing: int = 25  # rounds (smoothed, fig. 5c)
    spacing: float = 0.012  # of the height, from node to node in the result

    @classmethod
    def paper(cls) -> ParticleFlow:
        """What is printed; what it leaves open is set for flows that direction fields alone lead.

        Particles also join the traces of those that have passed: "the particle traces are stored as a
        3D branching graph" (sec. 6) is read so, since else the trunk would be a bundle of ways.
        """
        return cls(
            density_resolution=25,
            density_prior=False,
            visible_limbs=False,
            to_limb=0.0,
            detour=0.0,
            to_field=1.0,
            to_neighbour=0.6,
            sight=1.5,
            join=0.3,
        )

    def __call__(self, views: Sequence[View], *, rng: np.random.Generator) -> Skeleton:
        density = self._density(views)
        height = float(density.edge * density.alpha.shape[1])
        limbs = self._limbs(views, density, rng)
        start = density.sample(self.particles, rng=rng)
        rules = self.rules(density, start)
        limbs = Limbs(*densified(limbs.position, limbs.parent, limbs.radius, 0.5 * rules.join))
        start = start[~within_wood(start, limbs, density.edge)]
        fields = [self._field(view, density) for view in views]
        graph = trace_particles(start, limbs.position, limbs.parent, [v.camera for v in views], fields, rules)
        if self.detour:
            graph = straightened(graph, self.detour * height)
        graph = smoothed(without_stubs(graph, self.shortest * height), self.smoothing)
        if self.detour:
            graph = joined_forward(graph, 0.25 * self.detour * height)
        graph = thinned(graph, self.spacing * height)
        return Skeleton(graph.position, graph.parent, _radius(graph, limbs))

    def _density(self, views: Sequence[View]) -> DensityVolume:
        density = estimate_density(views, resolution=self.density_resolution, prior=self.density_prior)
        if not density.is_filled.any():
            names = ", ".join(view.photo.name for view in views)
            raise StageError(f"{names}: the views leave no density to grow from: check their strokes and azimuths")
        return density

    def _limbs(self, views: Sequence[View], density: DensityVolume, rng: np.random.Generator) -> Limbs:
        if not self.visible_limbs:
            return Limbs(np.zeros((1, 3)), np.array([-1]), np.array([np.nan]))
        hull = estimate_density(views, resolution=self.density_resolution, refine=False, prior=False)
        return limbs_in_space(views, hull, density, rng=rng)

    def rules(self, density: DensityVolume, start: NDArray[np.float64]) -> FlowRules:
        """The flow's rules in metres for particles that start at (N, 3): what is near depends on how dense they are."""
        filled = float(density.is_filled.sum()) * density.edge**3
        apart = (filled / len(start)) ** (1 / 3)
        return FlowRules(
            steps=self.steps,
            speed=FAR * float(np.linalg.norm(start, axis=1).max()) / self.steps,
            inertia=self.inertia,
            inertia_growth=self.inertia_growth,
            to_field=self.to_field,
            to_neighbour=self.to_neighbour,
            to_base=self.to_base,
            to_limb=self.to_limb,
            limb_share=self.limb_share,
            sight=self.sight * apart,
            join=self.join * apart,
            floor=FLOOR * density.edge * density.alpha.shape[1],
            join_traces=self.join_traces,
            least_turn=float(np.cos(np.deg2rad(self.least_turn_deg))),
        )

    def _field(self, view: View, density: DensityVolume) -> DirectionField:
        corner = density.low + density.edge * np.array(density.alpha.shape) * np.indices((2, 2, 2)).reshape(3, -1).T
        seen = view.camera.project(corner)
        return direction_field(
            view.branches.xy,
            view.branches.parent,
            np.array([seen.min(axis=0), seen.max(axis=0)]),
            resolution=self.field_resolution,
            blend=self.blend,
            reach=self.blend_reach * density.edge * density.alpha.shape[1] * view.camera.px_per_metre,
            share=self.blend_share,
        )


def within_wood(start: NDArray[np.float64], limbs: Limbs, margin: float) -> NDArray[np.bool_]:
    """Which points (N, 3) lie within visible limbs, or `margin` metres about them: such biomass is wood already."""
    known = np.isfinite(limbs.radius)
    if not known.any():
        return np.zeros(len(start), bool)
    gap, nearest = cKDTree(limbs.position[known]).query(start)
    return np.asarray(gap < limbs.radius[known][nearest] + margin)


def _radius(graph: Graph, limbs: Limbs) -> NDArray[np.float64]:
    return np.where(graph.limb >= 0, limbs.radius[np.maximum(graph.limb, 0)], np.nan)
