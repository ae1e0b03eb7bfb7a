"""Circle tracing: the circle, the straight-line test, forks, and the drawn tree."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from forestgen.tree.colour_model import Mixture
from forestgen.tree.skeleton import n_children
from forestgen.tree.strokes import draw_polyline
from forestgen.tree.trace.branch_colours import classify, drop_close
from forestgen.tree.trace.circle_tracing import (
    CircleTracing,
    TraceModels,
    clusters_on_circle,
    is_straight_line,
    trace_stroke,
    trunk_radius_px,
)
from forestgen.tree.trace.drafting import Draft
from tests.synthetic import drawn_tree


def lines(*paths: list[tuple[float, float]], width: int = 5) -> NDArray[np.bool_]:
    mask = np.zeros((200, 200), bool)
    for path in paths:
        mask |= draw_polyline(np.array(path, float), (200, 200), width)
    return mask


def test_the_printed_values_are_the_defaults() -> None:
    paper = CircleTracing()
    assert (paper.n_branch, paper.n_other, paper.circle_px, paper.least_turn_deg) == (5, 5, 50, 30)


def test_a_circle_finds_the_branches_that_it_crosses() -> None:
    wood = lines([(100, 190), (100, 100), (60, 40)], [(100, 100), (150, 60)])
    found = clusters_on_circle(wood, np.array([100.5, 100.5]), 30.0)
    expected = [(100.5, 130.5), (100.5 - 30 * 40 / np.hypot(40, 60), 100.5 - 30 * 60 / np.hypot(40, 60))]
    expected.append((100.5 + 30 * 50 / np.hypot(50, 40), 100.5 - 30 * 40 / np.hypot(50, 40)))
    assert len(found) == 3
    for place in expected:
        assert min(np.hypot(*(point - place)) for point in found) < 1.5


def test_a_run_over_the_first_point_of_the_circle_is_one_cluster() -> None:
    (point,) = clusters_on_circle(lines([(100, 100), (190, 100)]), np.array([100.5, 100.5]), 30.0)
    assert_allclose(point, [130.5, 100.5], atol=1.0)


def test_a_circle_all_on_wood_or_all_off_it_finds_nothing() -> None:
    for value in (True, False):
        assert clusters_on_circle(np.full((200, 200), value), np.array([100.0, 100]), 30.0) == []


def test_a_gap_on_the_straight_line_fails_the_test() -> None:
    wood = lines([(20, 100), (180, 100)])
    start, end = np.array([30.5, 100.5]), np.array([80.5, 100.5])
    assert is_straight_line(wood, start, end)
    wood[:, 55] = False
    assert not is_straight_line(wood, start, end)


def test_the_circle_follows_a_fork_that_no_stroke_passes() -> None:
    wood = lines([(100, 195), (100, 20)], [(100, 120), (160, 60)])
    models = TraceModels(wood, np.ones_like(wood), 25.0)
    draft = Draft(np.array([100.0, 195]))
    trace_stroke(models, draft, np.array([[100.0, 195], [100, 20]]), 0.6)
    graph = draft.finish(3.0)
    assert np.hypot(*(graph.xy - [160, 60]).T).min() < 25  # reaches to within one circle of the end
    assert (n_children(graph.parent) == 2).sum() == 1


def test_a_second_stroke_hangs_on_the_nearest_place_of_the_first() -> None:
    models = TraceModels(np.zeros((200, 200), bool), np.ones((200, 200), bool), 20.0)
    draft = Draft(np.array([100.0, 195]))
    trace_stroke(models, draft, np.array([[100.0, 195], [100, 20]]), 0.6)
    trace_stroke(models, draft, np.array([[103.0, 100], [160, 60]]), 0.6)
    graph = draft.finish(3.0)
    fork = np.flatnonzero(n_children(graph.parent) == 2)
    assert len(fork) == 1
    assert np.hypot(*(graph.xy[fork[0]] - [100, 100])) <= 10  # half a circle


def test_trunk_radius_is_that_of_the_largest_circle_inside() -> None:
    models = TraceModels(lines([(100, 250), (100, -50)], width=21), np.ones((200, 200), bool), 25.0)
    assert trunk_radius_px(models, np.array([[100.5, 195], [100.5, 20]])) == pytest.approx(10, abs=1)


def gaussian(*mean: float) -> Mixture:
    return Mixture(np.ones(1), np.array([mean]), np.eye(3)[None] * 0.01)


def test_pixels_go_to_the_likelier_model() -> None:
    rgb = np.array([[[90, 60, 40], [200, 210, 240]]], np.uint8)
    assert classify(rgb, gaussian(0.35, 0.25, 0.15), gaussian(0.8, 0.8, 0.95)).tolist() == [[True, False]]


def test_branch_colours_like_leaves_are_dropped_but_never_all() -> None:
    two = Mixture(
        np.array([0.5, 0.5]), np.array([[0.3, 0.2, 0.1], [0.2, 0.5, 0.2]]), np.eye(3)[None].repeat(2, 0) * 0.001
    )
    assert_allclose(drop_close(two, gaussian(0.2, 0.5, 0.2), 1.0).mean, [[0.3, 0.2, 0.1]])
    assert len(drop_close(gaussian(0.2, 0.5, 0.2), gaussian(0.2, 0.5, 0.2), 1.0)) == 1


@pytest.mark.parametrize("leaves", [False, True])
def test_the_drawn_trees_strokes_are_followed(leaves: bool) -> None:
    tree = drawn_tree(leaves=leaves)
    graph = CircleTracing()(tree.photo, tree.strokes, tree.mattes, rng=np.random.default_rng(0))
    assert_allclose(graph.xy[0], tree.strokes.root)
    for stroke in tree.strokes.branches:
        assert np.hypot(*(graph.xy - stroke[-1]).T).min() < 1
    assert graph.radius_px[0] == pytest.approx(tree.branches.radius_px[0], abs=2)
    assert np.isnan(graph.radius_px[1:]).all()
