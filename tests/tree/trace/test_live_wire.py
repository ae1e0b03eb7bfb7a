"""LiveWire: cheapest ways by hand and against SciPy, and the drawn tree's attractor graph."""

from __future__ import annotations

import logging
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.skeleton import n_children
from forestgen.tree.strokes import fill_outline
from forestgen.tree.trace.live_wire import LiveWire, trace_ways, worth_a_way
from forestgen.tree.trace.minimal_paths import STEPS, WayTree, cheapest_ways
from forestgen.tree.trace.seeds import silhouette_seeds
from forestgen.tree.trace.way_prices import PriceMap
from tests.synthetic import JOINTS, DrawnTree, drawn_tree

NEXT = np.array([(-1, 0), (1, 0), (0, -1), (0, 1)])


def test_a_way_goes_round_what_is_dear() -> None:
    price = np.array([[1.0, 1.0, 1.0], [1.0, 9.0, 1.0], [1.0, 9.0, 1.0]])
    cost, onward = cheapest_ways(price, 6, NEXT)  # to the lower left corner
    assert_allclose(cost.reshape(3, 3), [[2, 3, 4], [1, 6, 5], [0, 5, 6]])
    way, here = [], 8
    while here >= 0:
        way.append(here)
        here = int(onward[here])
    assert way == [8, 5, 2, 1, 0, 3, 6]


def test_what_no_way_reaches_stays_infinite() -> None:
    cost, onward = cheapest_ways(np.array([[1.0, np.inf, 1.0]]), 0, NEXT)
    assert_array_equal(cost, [0, np.inf, np.inf])
    with pytest.raises(ValueError, match="no way leads from pixel 2"):
        WayTree([0]).way(2, onward)


def plain_cost(price: NDArray[np.float64], target: int) -> NDArray[np.float64]:
    """The oracle: the same graph given to SciPy."""
    height, width = price.shape
    number = np.arange(height * width).reshape(height, width)
    rows, columns, costs = [], [], []
    for y, x in STEPS:
        here = number[max(0, -y) : height - max(0, y), max(0, -x) : width - max(0, x)]
        there = number[max(0, y) : height + min(0, y), max(0, x) : width + min(0, x)]
        rows.append(here.ravel())
        columns.append(there.ravel())
        costs.append(np.hypot(x, y) * (price.ravel()[here] + price.ravel()[there]).ravel() / 2)
    n = height * width
    graph = csr_array((np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n))
    return np.asarray(dijkstra(graph, indices=target))


def test_costs_are_those_of_dijkstra() -> None:
    price = np.random.default_rng(2).uniform(0.2, 3, (31, 24))
    cost, onward = cheapest_ways(price, 100, STEPS)
    assert_allclose(cost, plain_cost(price, 100))
    assert onward[100] == -1
    others = np.delete(np.arange(price.size), 100)
    assert (cost[onward[others]] < cost[others]).all()


def test_ways_over_a_plain_are_as_long_as_straight_lines() -> None:
    cost, _ = cheapest_ways(np.ones((61, 61)), 30 * 61 + 30, STEPS)
    row, column = np.divmod(np.arange(61 * 61), 61)
    straight = np.hypot(row - 30, column - 30)
    assert (cost >= straight - 1e-9).all()
    assert (cost <= 1.014 * straight + 1e-9).all()


def open_map(price: NDArray[np.float64], distance: NDArray[np.float32] | None = None) -> PriceMap:
    return PriceMap(price, np.zeros(price.shape, np.float32) if distance is None else distance, 1.0)


def test_a_way_through_leaves_meets_its_limb_at_sixty_degrees() -> None:
    price = np.ones((160, 120))
    price[:, 9:12] = 0.5  # a limb straight up, half as dear
    ways = WayTree([155 * 120 + 10])
    trace_ways(open_map(price), ways, np.array([[100.5, 40.5]]), 0.7)
    row, column = np.divmod(np.array(ways.pixel), 120)
    leaves = np.flatnonzero(column > 12)
    first, tip = leaves[0], leaves[-1]
    angle = np.rad2deg(np.arctan2(column[tip] - column[first], row[first] - row[tip]))
    assert angle == pytest.approx(60, abs=4)


def test_later_ways_join_earlier_ones() -> None:
    price = np.ones((100, 100))
    ways = WayTree([95 * 100 + 50])
    trace_ways(open_map(price), ways, np.array([[50.5, 5.5]]), 0.5)
    trace_ways(open_map(price), ways, np.array([[70.5, 5.5], [72.5, 8.5]]), 0.5)
    n = n_children(np.array(ways.parent))
    assert (n == 0).sum() == 3
    assert (np.array(ways.parent)[1:] < np.arange(1, len(ways.parent))).all()
    forks = np.divmod(np.array(ways.pixel)[n > 1], 100)
    assert (forks[0] < 60).all()  # both ran down the first way for its lower half
    row, column = divmod(ways.pixel[20], 100)
    trace_ways(open_map(price), ways, np.array([[column + 0.5, row + 0.5]]), 0.5)
    assert len(n) == len(ways.parent)  # a seed on the tree adds nothing


def test_little_wood_is_not_worth_a_long_way() -> None:
    seen = np.zeros((1, 30), np.float32)
    seen[0, :5] = 1
    prices = open_map(np.ones((1, 30)), seen)
    assert worth_a_way(list(range(20)), prices, 5, 3.0)
    assert not worth_a_way(list(range(21)), prices, 5, 3.0)
    assert not worth_a_way(list(range(10)), prices, 6, 3.0)
    assert worth_a_way(list(range(5)), prices, 6, 3.0)  # all of it is seen
    assert not worth_a_way([], prices, 0, 3.0)


def trace(tree: DrawnTree, seed: int = 0, **settings: object) -> BranchGraph:
    method = LiveWire(**settings)  # type: ignore[arg-type]
    return method(tree.photo, tree.strokes, tree.mattes, rng=np.random.default_rng(seed))


def apart(one: BranchGraph, other: BranchGraph) -> NDArray[np.float64]:
    """Distances (K,) px of points along the edges of one graph to the edges of the other."""
    mask = np.full((600, 600), 255, np.uint8)
    for node in range(1, len(other)):
        ends = np.round((other.xy[[node, other.parent[node]]] - 0.5) * 16).astype(np.int32)
        cv2.line(mask, ends[0].tolist(), ends[1].tolist(), 0, 1, cv2.LINE_8, 4)
    away = cv2.distanceTransform(mask, cv2.DIST_L2, 5)
    share = np.linspace(0, 1, 8)[:, None, None]
    points = (one.xy[one.parent[1:]] * (1 - share) + one.xy[1:] * share).reshape(-1, 2)
    column, row = points.astype(int).T
    return np.asarray(away[row, column])


def test_a_bare_drawn_tree_is_recovered() -> None:
    tree = drawn_tree(leaves=False)
    graph, truth = trace(tree), tree.branches
    n = n_children(graph.parent)
    assert (n == 0).sum() == 5
    assert apart(graph, truth).max() < 4
    assert np.percentile(apart(truth, graph), 95) < 4
    assert_allclose(graph.xy[0], tree.strokes.root)
    nearest = np.argmin(np.hypot(*np.moveaxis(graph.xy[:, None] - truth.xy, 2, 0)), axis=1)
    near = np.hypot(*(graph.xy - truth.xy[nearest]).T) < 4
    assert np.nanmedian(np.abs(graph.radius_px - truth.radius_px[nearest])[near]) < 1.2


def test_without_any_wood_the_silhouette_still_gives_a_tree() -> None:
    tree = drawn_tree()
    crown = fill_outline(tree.strokes.crown, tree.photo.size).astype(np.float32)
    bush = replace(tree, mattes=Mattes(crown, np.zeros_like(crown)))
    graph = trace(bush, seeds="silhouette", n_silhouette=12)
    assert 9 <= (n_children(graph.parent) == 0).sum() <= 13  # the trunk's own, and those that leave their limb enough
    assert np.isnan(graph.radius_px).all()
    step = graph.xy[1:] - graph.xy[graph.parent[1:]]
    assert np.average(step[:, 1] < 0, weights=np.hypot(*step.T)) > 0.8  # it grows upward
    column, row = graph.xy.astype(int).T
    below = row > bush.strokes.crown[:, 1].max()
    assert (crown[row, column] > 0)[~below].mean() > 0.8  # and within the crown


def test_random_seeds_are_the_seeds_of_the_generator() -> None:
    tree = drawn_tree()
    one, again, other = (trace(tree, seed, seeds="both") for seed in (1, 1, 2))
    assert_array_equal(one.xy, again.xy)
    assert_array_equal(one.parent, again.parent)
    assert one.xy.shape != other.xy.shape or not np.allclose(one.xy, other.xy)
    assert_array_equal(trace(tree, 1).xy, trace(tree, 2).xy)  # nothing is drawn where the strokes are the seeds


@pytest.mark.parametrize("seeds", ["strokes", "silhouette", "both"])
def test_behind_leaves_the_graph_stays_in_the_photo_and_reaches_its_forks(seeds: str) -> None:
    tree = drawn_tree()
    graph = trace(tree, seeds=seeds)
    assert ((graph.xy >= 0) & (graph.xy <= tree.photo.size)).all()
    assert (graph.parent[1:] < np.arange(1, len(graph))).all()
    assert np.isnan(graph.radius_px).any()
    assert np.isfinite(graph.radius_px[0])
    fork = tree.camera.project(JOINTS[[2]])
    assert np.hypot(*(graph.xy - fork).T).min() < 12


def test_a_stroke_that_ends_far_from_the_tree_is_no_seed(caplog: pytest.LogCaptureFixture) -> None:
    tree = drawn_tree()
    width = tree.photo.size[0]
    astray = np.array([tree.strokes.root, [width - 5.0, tree.strokes.root[1] - 5]])
    drawn = replace(tree.strokes, branches=(*tree.strokes.branches, astray))
    with caplog.at_level(logging.WARNING):
        graph = trace(replace(tree, strokes=drawn))
    assert "1 branch strokes end far from the tree" in caplog.text
    assert graph.xy[:, 0][graph.xy[:, 1] > tree.strokes.root[1] - 40].max() < width - 60


def test_silhouette_seeds_lie_around_the_crown() -> None:
    tree = drawn_tree()
    crown = fill_outline(tree.strokes.crown, tree.photo.size).astype(np.float32)
    mattes = Mattes(crown, np.zeros_like(crown))
    seeds = silhouette_seeds(mattes, tree.strokes, 16, rng=np.random.default_rng(0))
    away = cv2.distanceTransform(crown.astype(np.uint8), cv2.DIST_L2, 5)
    column, row = seeds.astype(int).T
    assert away[row, column].max() < 6  # a closing rounds corners off
    around = np.sort(np.arctan2(*(seeds - seeds.mean(axis=0)).T))
    assert np.diff(around).max() < 1.2  # on all sides
    empty = Mattes(0 * crown, 0 * crown)
    assert silhouette_seeds(empty, tree.strokes, 16, rng=np.random.default_rng(0)).shape == (0, 2)
