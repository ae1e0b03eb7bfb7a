"""Figure 4: fields and flows of one attractor graph in a plane."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.tree.lift.direction_field import Blend, graph_points
from forestgen.tree.lift.flow_in_plane import flow_in_plane
from forestgen.tree.lift.flow_tracing import Graph
from forestgen.tree.skeleton import n_children, tips_beyond

#  2   3
#   \ /
#    1
#    0
XY = np.array([[100.0, 200], [100, 130], [50, 60], [150, 60]])
PARENT = np.array([-1, 0, 1, 1])
START = np.random.default_rng(2).uniform([10, 10], [190, 110], (150, 2))


def flow(blend: Blend, *, attraction: bool) -> Graph:
    return flow_in_plane(XY, PARENT, START, blend=blend, attraction=attraction)[1]


def length(graph: Graph) -> float:
    return float(np.linalg.norm(graph.position[1:] - graph.position[graph.parent[1:]], axis=1).sum())


def beside_trunk(graph: Graph) -> NDArray[np.float64]:
    """Distances (N,) px from the attractor graph's trunk, of the nodes between a quarter and half its height."""
    low = (graph.position[:, 1] > 17) & (graph.position[:, 1] < 35)
    return np.asarray(np.abs(graph.position[low, 0]))


@pytest.mark.parametrize(("blend", "attraction"), [("linear", False), ("constant", True), ("linear", True)])
def test_all_particles_reach_the_root_in_the_plane(blend: Blend, attraction: bool) -> None:
    graph = flow(blend, attraction=attraction)
    assert tips_beyond(graph.parent)[0] == len(START)
    assert np.abs(graph.position[:, 2]).max() == 0


def test_without_attraction_ways_run_side_by_side_and_with_it_they_become_one() -> None:
    alone, together = flow("linear", attraction=False), flow("linear", attraction=True)
    assert n_children(alone.parent)[0] == len(START)  # (c): every particle has a way of its own
    assert n_children(together.parent)[0] <= 3  # (e)
    assert length(together) < 0.5 * length(alone)
    assert beside_trunk(together).max() < 8


def test_linear_blending_follows_the_graph() -> None:
    graph = flow("linear", attraction=True)
    line = cKDTree(graph_points(XY, PARENT, 1.0)[0])
    thick = tips_beyond(graph.parent) >= 30
    seen = graph.position[thick, :2] * [1, -1] + XY[0]
    assert np.median(line.query(seen)[0]) < 6
    assert line.query(seen)[0].max() < 25


def test_constant_blending_keeps_an_angle_to_the_graph() -> None:
    field, _ = flow_in_plane(XY, PARENT, START, blend="constant", attraction=True, share=0.5)
    beside = np.array([[60.0, 165], [80, 165], [140, 165]])
    angle = np.degrees(np.arctan2(np.abs(field.at(beside)[:, 0]), field.at(beside)[:, 1]))
    np.testing.assert_allclose(angle, 45, atol=2)
    linear, _ = flow_in_plane(XY, PARENT, START, blend="linear", attraction=True)
    angle = np.degrees(np.arctan2(np.abs(linear.at(beside)[:, 0]), linear.at(beside)[:, 1]))
    assert angle[0] > angle[1] + 10  # flatter from afar
