"""A skeleton as JSON comes back as it was, and other programs read it as a graph."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.errors import InputError
from forestgen.tree.skeleton_json import skeleton_from_json, skeleton_json
from tests.tree.skeletons import fork, random_tree


def test_round_trip() -> None:
    skeleton = random_tree(300, rng=np.random.default_rng(1))
    back = skeleton_from_json(json.loads(json.dumps(skeleton_json(skeleton))), "tree.json")
    assert_array_equal(back.parent, skeleton.parent)
    assert_allclose(back.position, skeleton.position, atol=6e-6)
    assert_allclose(back.radius, skeleton.radius, atol=6e-7)


def test_nodes_say_where_they_belong() -> None:
    #   4
    #   3   7
    #   2 5 6
    #   1
    #   0
    nodes = skeleton_json(fork())["nodes"]
    assert nodes["parent"] == [-1, 0, 1, 2, 3, 2, 5, 6]
    assert nodes["limb"] == [0] * 5 + [1] * 3
    assert nodes["level"] == [0] * 5 + [1] * 3
    assert nodes["position"][2] == [0.0, 2.0, 0.0]
    assert nodes["radius"][7] == 0.1


def test_networkx_reads_it_in_three_lines(tmp_path: Path) -> None:
    networkx = pytest.importorskip("networkx")
    skeleton = random_tree(200, rng=np.random.default_rng(1))
    path = tmp_path / "skeleton.json"
    path.write_text(json.dumps(skeleton_json(skeleton)))

    nodes = json.loads(path.read_text())["nodes"]
    graph = networkx.DiGraph((above, node) for node, above in enumerate(nodes["parent"]) if above >= 0)
    rows = enumerate(zip(*nodes.values(), strict=True))
    networkx.set_node_attributes(graph, {node: dict(zip(nodes, row, strict=True)) for node, row in rows})

    assert networkx.is_arborescence(graph)
    tips = [node for node in graph if graph.out_degree(node) == 0]
    assert len(tips) == np.sum(np.bincount(skeleton.parent[1:], minlength=200) == 0)
    assert networkx.descendants(graph, 0) == set(range(1, 200))
    assert graph.nodes[17]["parent"] == skeleton.parent[17]
    assert_allclose(graph.nodes[17]["position"], skeleton.position[17], atol=1e-5)


@pytest.mark.parametrize(
    "data",
    [
        {},
        {"version": 2, "nodes": []},
        {"version": 1},
        {"version": 1, "nodes": []},
        {"version": 1, "nodes": {"parent": [-1]}},
        {"version": 1, "nodes": {"parent": [], "position": [], "radius": []}},
        {"version": 1, "nodes": {"parent": [-1, 5], "position": [[0, 0, 0], [0, 1, 0]], "radius": [1, 1]}},
        {"version": 1, "nodes": {"parent": [None], "position": [[0, 0, 0]], "radius": [1]}},
        {"version": 1, "nodes": {"parent": [-1], "position": [[0, 0]], "radius": [1]}},
        {"version": 1, "nodes": 7},
        [1],
    ],
)
def test_what_is_no_skeleton_is_refused(data: Any) -> None:
    with pytest.raises(InputError, match=r"^x\.json: is no skeleton.*expected"):
        skeleton_from_json(data, "x.json")
