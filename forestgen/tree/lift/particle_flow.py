"""Particle flow: biomass flows down to the root along the visible branches of all views, and leaves a skeleton."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.errors import StageError
from forestgen.tree.density import DensityVolume
from forestgen.tree.density_views import estimate_density
from forestgen.tree.lift.direction_field import Blend, DirectionField, direction_field
from forestgen.tree.lift.flow_limbs import limbs_in_space
from forestgen.tree.lift.flow_smoothing import smoothed, thinned, without_stubs
from forestgen.tree.lift.flow_tracing import FlowRules, Graph, trace_particles
from forestgen.tree.lift.flow_trunk import Limbs
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
    blend: Blend = "linear"  # h(d) of eq. 3; sec. 7, "the mostly used case"
    blend_reach: float = 0.15  # of the height, where a linear h reaches 1; not printed
    blend_share: float = 0.5  # a constant h; not printed
    visible_limbs: bool = True  # ours
    to_field: float = 1.0  # weights of what drives a particle; none is printed
    to_neighbour: float = 0.6
    to_base: float = 0.3
    to_limb: float = 1.0  # ours
    limb_share: float = 0.65  # ours: h for limbs in space, constant: branches leave them at this angle
    inertia: float = 2.0  # steps in which a single particle turns; sec. 6 has a mass without a value
    inertia_growth: float = 0.3  # exponent of the number of joined particles in their mass
    sight: float = 1.5  # of the particles' mean distance: how far they attract
    join: float = 0.3  # of the particles' mean distance: how near they join
    join_traces: bool = True  # ours: also with the trace of one that has passed, so that nothing runs beside it
    least_turn_deg: float = 75.0  # ours: between a particle's way and a trace that it joins
    shortest: float = 0.02  # of the height: shorter branches fall (chiselled, fig. 5c)
    smoothing: int = 20  # rounds (smoothed, fig. 5c)
    spacing: float = 0.012  # of the height, from node to node in the result

    def __call__(self, views: Sequence[View], *, rng: np.random.Generator) -> Skeleton:
        density = estimate_density(views, resolution=self.density_resolution)
        height = float(density.edge * density.alpha.shape[1])
        limbs = limbs_in_space(views, density, rng=rng) if self.visible_limbs else _root()
        start = self._start(density, views, rng)
        rules = self._rules(density, start)
        dense = densified(limbs, 0.5 * rules.join)
        fields = [self._field(view, density) for view in views]
        graph = trace_particles(start, dense.position, dense.parent, [v.camera for v in views], fields, rules)
        graph = smoothed(without_stubs(graph, self.shortest * height), self.smoothing)
        graph = thinned(graph, self.spacing * height)
        return Skeleton(graph.position, graph.parent, _radius(graph, dense))

    def _start(self, density: DensityVolume, views: Sequence[View], rng: np.random.Generator) -> NDArray[np.float64]:
        if not density.is_filled.any():
            names = ", ".join(view.photo.name for view in views)
            raise StageError(f"{names}: the views leave no density to grow from: check their strokes and azimuths")
        return density.sample(self.particles, rng=rng)

    def _rules(self, density: DensityVolume, start: NDArray[np.float64]) -> FlowRules:
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


def densified(limbs: Limbs, spacing: float) -> Limbs:
    """The limbs with nodes at most `spacing` metres apart; radii between two known ones are interpolated."""
    parent = np.maximum(limbs.parent, 0)
    way = limbs.position - limbs.position[parent]
    count = np.maximum(np.ceil(np.linalg.norm(way, axis=1) / spacing), 1).astype(np.int64)
    last = np.cumsum(count) - 1  # where each node of the limbs goes
    node = np.repeat(np.arange(len(count)), count)
    within = np.arange(len(node)) - (last - count)[node]
    share = within / count[node]
    position = limbs.position[parent[node]] + share[:, None] * way[node]
    radius = limbs.radius[parent[node]] + share * (limbs.radius[node] - limbs.radius[parent[node]])
    radius[within == count[node]] = limbs.radius
    before = np.arange(len(node)) - 1
    before[last - count + 1] = np.where(limbs.parent >= 0, last[parent], -1)
    return Limbs(position, before, radius)


def _root() -> Limbs:
    return Limbs(np.zeros((1, 3)), np.array([-1]), np.array([np.nan]))


def _radius(graph: Graph, limbs: Limbs) -> NDArray[np.float64]:
    return np.where(graph.limb >= 0, limbs.radius[np.maximum(graph.limb, 0)], np.nan)
