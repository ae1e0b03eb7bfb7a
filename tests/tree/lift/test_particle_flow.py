"""Particle flow: kernels against plain ones, joining, a fork known in space recovered from its views."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import cKDTree

from forestgen.arrays import stage_rng
from forestgen.camera import Camera
from forestgen.errors import StageError
from forestgen.tree.density_views import estimate_density
from forestgen.tree.lift.direction_field import direction_field
from forestgen.tree.lift.flow_kernels import runge_kutta
from forestgen.tree.lift.flow_tracing import lens_of
from forestgen.tree.lift.particle_flow import ParticleFlow
from forestgen.tree.mattes import Mattes
from forestgen.tree.skeleton import Skeleton, n_children
from forestgen.tree.view import View
from tests.tree.lift import plain_flow
from tests.tree.lift.flow_trees import FORK, HEIGHT, distance_to, fork_view, tips, without_graph

TWO = [fork_view(0), fork_view(90)]


def flow(views: list[View], seed: int = 0, **settings: Any) -> Skeleton:
    return ParticleFlow(**{"particles": 200, "density_resolution": 24, **settings})(views, rng=stage_rng(seed, "lift"))


@pytest.mark.parametrize("focal_px", [None, 500.0])
def test_a_compiled_step_equals_a_plain_one(focal_px: float | None) -> None:
    rng = np.random.default_rng(1)
    cameras = [
        Camera((300, 320), (150.0, 300.0), 60.0, azimuth=a, elevation=e, focal_px=focal_px)
        for a, e in ((0.0, 0.0), (1.4, 0.1))
    ]
    views = [fork_view(0), fork_view(80)]
    box = np.array([[0.0, 0], [300, 320]])
    fields = [direction_field(v.branches.xy, v.branches.parent, box, resolution=20, reach=60.0) for v in views]
    x, v = rng.uniform([-2, 0, -2], [2, 4, 2], (40, 3)), rng.normal(0, 0.05, (40, 3))
    mass, steady = rng.uniform(1, 4, 40), rng.normal(0, 0.5, (40, 3))
    expected = plain_flow.runge_kutta(x, v, mass, steady, cameras, fields, 0.8, 0.07)
    lens = np.array([lens_of(c) for c in cameras])
    grid = np.array([[*f.low, *f.step] for f in fields])
    runge_kutta(x, v, mass, steady, lens, grid, np.array([f.vector for f in fields]), 0.8, 0.07)
    assert_allclose(x, expected[0], atol=1e-12)
    assert_allclose(v, expected[1], atol=1e-12)


def test_the_fork_is_recovered_from_two_views() -> None:
    skeleton = flow(TWO)
    for joint in FORK.position:
        assert distance_to(skeleton, joint) < 0.03 * HEIGHT
    assert_allclose(skeleton.position[0], 0, atol=1e-9)


@pytest.mark.parametrize("settings", [{}, {"visible_limbs": False, "to_limb": 0.0}])
def test_everything_ends_at_one_root_and_nothing_below_it(settings: dict[str, Any]) -> None:
    skeleton = flow(TWO, **settings)
    assert np.isfinite(skeleton.position).all()
    assert skeleton.position[:, 1].min() >= -0.02 * HEIGHT
    assert 30 < len(tips(skeleton)) <= 200 + len(tips(FORK))


def test_measured_radii_come_along_on_the_trunk() -> None:
    skeleton = flow(TWO)
    low = (skeleton.position[:, 1] < 1.0) & np.isfinite(skeleton.radius)
    assert low.any()
    assert_allclose(skeleton.radius[low].max(), 0.15, rtol=0.05)


def test_same_seed_same_tree_another_seed_another_one() -> None:
    assert flow(TWO, 3).position.tobytes() == flow(TWO, 3).position.tobytes()
    assert flow(TWO, 3).position.tobytes() != flow(TWO, 4).position.tobytes()


def test_one_particle_is_a_tree() -> None:
    for visible in (True, False):
        skeleton = flow(TWO, particles=1, visible_limbs=visible, to_limb=float(visible))
        assert len(skeleton) >= 2
        assert n_children(skeleton.parent)[0] >= 1


def test_the_trunk_stroke_stands_in_for_a_graph() -> None:
    skeleton = flow([without_graph(view) for view in TWO])
    for joint in FORK.position[:3]:
        assert distance_to(skeleton, joint) < 0.03 * HEIGHT


@pytest.mark.parametrize("azimuths", [[0], [0, 120], [0, 60, 130]])
def test_one_view_or_three_from_any_side(azimuths: list[float]) -> None:
    skeleton = flow([fork_view(a) for a in azimuths])
    view = fork_view(0)
    flat = np.column_stack([view.camera.project(skeleton.position), np.zeros(len(skeleton))])
    seen = Skeleton(flat, skeleton.parent, skeleton.radius)
    for xy in view.branches.xy:
        assert distance_to(seen, np.array([*xy, 0.0])) < 0.02 * HEIGHT * 60


def test_bare_wood_is_followed() -> None:
    skeleton = flow([fork_view(0, leaves=False), fork_view(90, leaves=False)])
    for joint in FORK.position:
        assert distance_to(skeleton, joint) < 0.03 * HEIGHT


def test_inputs_are_unchanged() -> None:
    before = TWO[0].branches.xy.copy()
    flow(TWO)
    assert_array_equal(TWO[0].branches.xy, before)


def test_hardly_any_wood_crosses_what_a_view_shows_to_be_empty() -> None:
    hull = estimate_density(TWO, resolution=48, refine=False, prior=False)
    skeleton = flow(TWO)
    step = skeleton.position[1:] - skeleton.position[skeleton.parent[1:]]
    filled = hull.centres()[hull.is_filled.ravel()]
    off = cKDTree(filled).query(skeleton.position[1:] - 0.5 * step)[0] > 1.5 * hull.edge
    length = np.linalg.norm(step, axis=1)
    assert length[off].sum() < 0.05 * length.sum()


@pytest.mark.parametrize("azimuth", [0, 90])
def test_the_trunk_appears_where_it_was_traced_in_both_views(azimuth: float) -> None:
    skeleton, view = flow(TWO), fork_view(azimuth)
    low = (skeleton.position[:, 1] < 2.0) & np.isfinite(skeleton.radius)
    seen = view.camera.project(skeleton.position[low])
    traced = np.interp(-seen[:, 1], -view.branches.xy[:3, 1], view.branches.xy[:3, 0])
    assert np.abs(seen[:, 0] - traced).max() < 1.0


def test_the_papers_setting_keeps_what_is_printed() -> None:
    paper = ParticleFlow.paper()
    assert (paper.particles, paper.steps, paper.field_resolution, paper.density_resolution) == (1000, 200, 100, 25)
    assert paper.blend == "linear"
    assert not any((paper.visible_limbs, paper.density_prior, paper.to_limb, paper.detour))


def test_a_view_without_tree_is_told() -> None:
    empty = replace(TWO[1], mattes=Mattes(*[np.zeros((320, 300), np.float32)] * 2))
    with pytest.raises(StageError, match="fork_90"):
        flow([TWO[0], empty])
