"""A bushy tree for levels of detail: thin twigs without end, leaves of two shapes on them."""

from __future__ import annotations

from functools import cache

import numpy as np

from forestgen.tree.leaf_blades import build_blade, trim
from forestgen.tree.level import NO_LEAVES
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Atlas, Bark, LeafPrototype, Leaves, TreeModel
from forestgen.tree.skeleton import Skeleton, n_children
from tests.tree.skeletons import random_tree

CELL = 64  # px of a leaf in the atlas, a side
BARK = Bark(np.full((1, 1, 3), 90, np.uint8), 0.5, 0.5)


def blade_atlas(colours: tuple[tuple[int, int, int], ...] = ((60, 120, 40), (120, 150, 60))) -> Atlas:
    """Ellipses with a petiole, side by side, one of each colour; blades as those of real atlases."""
    y, x = (np.mgrid[:CELL, :CELL] + 0.5) / CELL
    alpha = (np.hypot((x - 0.5) / 0.3, (y - 0.42) / 0.42) < 1) | ((abs(x - 0.5) < 0.02) & (y > 0.8))
    cells = [np.dstack([np.tile(np.array(c, np.uint8), (CELL, CELL, 1)), alpha * np.uint8(255)]) for c in colours]
    rgba = np.hstack(cells)
    return Atlas(rgba, tuple(blade(k, len(cells), np.array(c) / 255) for k, c in enumerate(colours)))


def blade(k: int, n: int, colour: np.ndarray) -> LeafPrototype:
    """The leaf over the k-th of n cells, meshed as the atlas does it: petiole, folded and curled blade."""
    y, x = (np.mgrid[:CELL, :CELL] + 0.5) / CELL
    shape = build_blade(
        trim((np.hypot((x - 0.5) / 0.3, (y - 0.42) / 0.42) < 1) * 1.0), CELL, rng=np.random.default_rng(k)
    )
    uv = np.column_stack([(k + 0.5 + shape.flat[:, 0]) / n, shape.flat[:, 1]])
    return LeafPrototype(shape.points, shape.normals, uv, shape.faces, colour, 20.0)


@cache
def bushy_tree(n_leaves: int, n_nodes: int = 1500) -> TreeModel:
    """A random tree 6 m tall with leaves about its twigs, the lower half of them of the second colour."""
    rng = np.random.default_rng(3)
    skeleton = random_tree(n_nodes, rng=rng)
    grown = 6.0 / np.ptp(skeleton.position[:, 1])
    skeleton = Skeleton(skeleton.position * grown, skeleton.parent, skeleton.radius * grown)
    tips = np.flatnonzero(n_children(skeleton.parent) == 0)
    at = skeleton.position[rng.choice(tips, n_leaves)] + rng.normal(0, 0.08, (n_leaves, 3))
    turn = rng.normal(size=(n_leaves, 4))
    leaves = Leaves(
        position=at,
        orientation=turn / np.linalg.norm(turn, axis=1, keepdims=True),
        size=rng.uniform(0.1, 0.2, n_leaves),
        prototype=(at[:, 1] < np.median(at[:, 1])).astype(np.int64) if n_leaves else np.zeros(0, np.int64),
    )
    return TreeModel(
        name="bush",
        method="tan2008",
        seed=3,
        height=6.0,
        views=(),
        skeleton=skeleton,
        mesh=GeneralisedCylinders()(skeleton, BARK),
        bark=BARK,
        atlas=blade_atlas() if n_leaves else Atlas(np.zeros((1, 1, 4), np.uint8), ()),
        leaves=leaves if n_leaves else NO_LEAVES,
    )
