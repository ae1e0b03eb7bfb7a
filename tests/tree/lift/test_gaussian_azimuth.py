"""GaussianAzimuth: angles as printed, depth by hand, the projection unchanged, bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.errors import StageError
from forestgen.tree.branch_paths import cut_into_paths
from forestgen.tree.lift.gaussian_azimuth import GaussianAzimuth, golden_step, turn_angles, turned_depth
from tests.synthetic import drawn_tree

# A trunk of 7 m; side branches at 1, 2, ... 5 m, each 2 m long and level, left and right in turn.
TRUNK = np.column_stack([np.zeros(8), np.arange(8.0)])
SIDES = np.array([[[s * d, y] for d in (1.0, 2.0)] for y, s in zip(range(1, 6), (1, -1, 1, -1, 1), strict=True)])
FLAT = np.concatenate([TRUNK, SIDES.reshape(-1, 2)])
PARENT = np.array([-1, *range(7), *np.column_stack([np.arange(1, 6), np.arange(8, 18, 2)]).ravel()])
PATHS = cut_into_paths(FLAT, PARENT, 0.1)


def test_angles_are_evenly_spread() -> None:
    angle = turn_angles(PATHS, 0.0, False, rng=np.random.default_rng(3))
    sides = np.argsort(PATHS.base)[1:]  # the trunk's base is the root
    assert angle[0] == 0
    assert_allclose(np.diff(angle[sides]), -2 * np.pi / 5)  # mu + 2 pi (k - i) / k
    apart = turn_angles(PATHS, 0.0, True, rng=np.random.default_rng(3))
    assert_allclose(np.sort(np.mod(apart[1:] - apart[1], 2 * np.pi)), 2 * np.pi * np.arange(5) / 5, atol=1e-9)
    assert (np.abs(np.angle(np.exp(1j * np.diff(apart[sides])))) > 2 * np.pi / 5 + 0.1).all()  # neighbours: two slots


def test_angles_are_gaussian() -> None:
    off = [
        np.angle(np.exp(1j * np.diff(turn_angles(PATHS, 0.3, False, rng=np.random.default_rng(s))[1:]))) + 2 * np.pi / 5
        for s in range(400)
    ]
    assert abs(np.mean(off)) < 0.05
    assert_allclose(np.std(off), 0.3 * np.sqrt(2), rtol=0.06)  # a difference of two


def test_the_golden_step_meets_all() -> None:
    for k in range(1, 40):
        assert len({i * golden_step(k) % k for i in range(k)}) == k
    assert golden_step(8) == 3


def test_depth_by_hand() -> None:
    angle = np.zeros(len(PATHS))
    angle[1:] = np.deg2rad([30, -30, 150, 80, 0])
    depth = turned_depth(FLAT, PATHS, angle, 0.8, 100.0)
    expected = np.tan(np.deg2rad(30))
    tips = [PATHS.nodes[b][-1] for b in range(1, 6)]
    assert_allclose(depth[tips], [2 * expected, -2 * expected, 2 * expected, 0.8 * 2, 0])  # bounded by 0.8 of 2 m
    feet = [PATHS.nodes[b][0] for b in range(1, 6)]
    assert_allclose(depth[feet], depth[tips] / 2)  # in proportion to the lateral offset
    assert (depth[:8] == 0).all()
    steep = turned_depth(FLAT, PATHS, angle, 10.0, 1.0)
    assert_allclose(steep[tips[3]], 2.0)  # tangent at most 1


def test_what_runs_along_a_leaning_branch_leans_with_it() -> None:
    #  a limb to the right; a twig on it that goes on to the right, a little upward
    flat = np.array([[0, 0], [0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 2], [3, 2], [2, 2.5]], float)
    paths = cut_into_paths(flat, np.array([-1, 0, 1, 2, 3, 2, 5, 6, 5]), 0.1)
    angle = np.zeros(len(paths))
    limb = next(b for b in range(len(paths)) if 7 in paths.nodes[b])
    angle[limb] = np.deg2rad(20)
    depth = turned_depth(flat, paths, angle, 0.8, 100.0)
    assert_allclose(depth[8] - depth[5], depth[6] - depth[5])  # as far along, as deep


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("azimuth", [0.0, 0.7])
def test_the_projection_stays(seed: int, azimuth: float) -> None:
    tree = drawn_tree(px_per_metre=40.0)
    view = replace(tree.view, camera=replace(tree.camera, azimuth=azimuth, elevation=0.1))
    lifted = GaussianAzimuth()([view], rng=np.random.default_rng(seed))
    assert_allclose(view.camera.project(lifted.position), tree.branches.xy, atol=1e-9)
    deep = view.camera.depth(lifted.position)
    assert np.ptp(deep) > 0.5
    flat = np.linalg.norm(np.diff(lifted.position, axis=0), axis=1)
    assert np.isfinite(flat).all()


def test_bad_settings_are_refused() -> None:
    for settings in ({"spread_deg": -1.0}, {"farthest": -0.1}, {"steepest_deg": 90.0}):
        with pytest.raises(ValueError, match=next(iter(settings))):
            GaussianAzimuth(**settings)
    tree = drawn_tree(px_per_metre=20.0)
    with pytest.raises(StageError, match="came 2"):
        GaussianAzimuth()([tree.view, tree.view], rng=np.random.default_rng(0))
