"""A skeleton as JSON: a list of nodes that any graph library reads, and back.

    {"version": 1, "units": "m", "up": "Y",
     "nodes": [{"id": 0, "parent": null, "position": [x, y, z], "radius": r, "limb": 0, "level": 0,
                "children": [1]}, ...]}

Parents come before their children; `limb` numbers the unbranched runs that the mesh is made of, `level` is
their branch order (0 the trunk). Lengths are rounded to micrometres. With networkx:

    nodes = json.loads(Path("skeleton.json").read_text())["nodes"]
    graph = networkx.DiGraph((n["parent"], n["id"]) for n in nodes if n["parent"] is not None)
    graph.add_nodes_from((n["id"], n) for n in nodes)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from forestgen.errors import InputError
from forestgen.tree.limb_tree import limb_tree
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.wind import wind_of

VERSION = 1
DIGITS = 6  # after the point: micrometres
EXPECTED = 'expected {"version": 1, "nodes": [...]} as `forestgen export` writes it'


def skeleton_json(skeleton: Skeleton) -> dict[str, Any]:
    """A skeleton as plain dictionaries and lists, ready for `json.dump`. Nodes that lie on their parent are dropped.

    Raises:
        ValueError: a radius is NaN or negative.
    """
    tree = limb_tree(skeleton)
    level = wind_of(tree).level[tree.limb_of_node].tolist()
    parent = tree.skeleton.parent.tolist()
    children: list[list[int]] = [[] for _ in parent]
    for node, above in enumerate(parent[1:], 1):
        children[above].append(node)
    nodes = [
        {
            "id": node,
            "parent": above if above >= 0 else None,
            "position": position,
            "radius": radius,
            "limb": limb,
            "level": level[node],
            "children": children[node],
        }
        for node, (above, position, radius, limb) in enumerate(
            zip(
                parent,
                np.round(tree.skeleton.position, DIGITS).tolist(),
                np.round(tree.skeleton.radius, DIGITS).tolist(),
                tree.limb_of_node.tolist(),
                strict=True,
            )
        )
    ]
    return {"version": VERSION, "units": "m", "up": "Y", "nodes": nodes}


def skeleton_from_json(data: Mapping[str, Any], source: str) -> Skeleton:
    """The skeleton that was written; `source` is named where it is none.

    Raises:
        InputError: it is no skeleton, or of another version.
    """
    if not isinstance(data, Mapping) or data.get("version") != VERSION:
        raise InputError(f"{source}: is no skeleton of version {VERSION}; {EXPECTED}")
    try:
        nodes = data["nodes"]
        parent = [-1 if node["parent"] is None else int(node["parent"]) for node in nodes]
        position = np.array([node["position"] for node in nodes], float)
        return Skeleton(position, np.array(parent, np.int64), np.array([node["radius"] for node in nodes], float))
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{source}: is no skeleton ({type(error).__name__}: {error}); {EXPECTED}") from error
