"""A skeleton as JSON: columns of a list of nodes, that any graph library reads, and back.

    {"version": 1, "units": "m", "up": "Y",
     "nodes": {"parent": [-1, 0, ...], "position": [[x, y, z], ...], "radius": [...], "limb": [...], "level": [...]}}

Parents come before their children; -1 is above the root. `limb` numbers the unbranched runs that the mesh is made
of, `level` is their branch order (0 the trunk). Columns take a third of the bytes of nodes one by one. With networkx:

    nodes = json.loads(Path("skeleton.json").read_text())["nodes"]
    graph = networkx.DiGraph((above, node) for node, above in enumerate(nodes["parent"]) if above >= 0)
    networkx.set_node_attributes(graph, {node: dict(zip(nodes, row)) for node, row in enumerate(zip(*nodes.values()))})
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
POSITION_DIGITS, RADIUS_DIGITS = 5, 6  # after the point: hundredths of a millimetre, and thousandths
EXPECTED = 'expected {"version": 1, "nodes": {"parent", "position", "radius", ...}} as a build writes it'


def skeleton_json(skeleton: Skeleton) -> dict[str, Any]:
    """A skeleton as plain dictionaries and lists, ready for `json.dump`. Nodes that lie on their parent are dropped.

    Raises:
        ValueError: a radius is NaN or negative.
    """
    tree = limb_tree(skeleton)
    nodes = {
        "parent": tree.skeleton.parent.tolist(),
        "position": np.round(tree.skeleton.position, POSITION_DIGITS).tolist(),
        "radius": np.round(tree.skeleton.radius, RADIUS_DIGITS).tolist(),
        "limb": tree.limb_of_node.tolist(),
        "level": wind_of(tree).level[tree.limb_of_node].tolist(),
    }
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
        columns = [
            np.array(nodes[name], kind) for name, kind in (("position", float), ("parent", int), ("radius", float))
        ]
        return Skeleton(*columns)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{source}: is no skeleton ({type(error).__name__}: {error}); {EXPECTED}") from error
