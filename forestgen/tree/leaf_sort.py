"""The order in which a tree keeps its leaves: by prototype, then limb by limb from its base to its tip.

It draws nothing new and loses nothing: files store runs of a prototype, and limbs that rise, in a fraction
of the bytes (usd/), and renderers find the leaves of one prototype side by side.
"""

from __future__ import annotations

import numpy as np

from forestgen.tree.limb_tree import limb_tree, nearest_unit
from forestgen.tree.model import Leaves
from forestgen.tree.skeleton import Skeleton


def sorted_leaves(leaves: Leaves, skeleton: Skeleton) -> Leaves:
    """The same leaves (L,), those of one prototype together, each on the limb whose wood is nearest to its foot.

    Raises:
        ValueError: a radius of the skeleton is NaN or negative.
    """
    if not len(leaves):
        return leaves
    tree = limb_tree(skeleton)
    node, along = nearest_unit(leaves.position, tree.skeleton)
    return leaves.take(np.lexsort((along, node, tree.limb_of_node[node], leaves.prototype)))
