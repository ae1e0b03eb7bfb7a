"""Small trees for the card tests: a trunk, and leaves in a ball, few of them or none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Atlas, LeafPrototype, Leaves, TreeModel
from forestgen.tree.skeleton import Skeleton
from tests.usd.models import tree_model

HEIGHT = 4.0


def square_leaf() -> LeafPrototype:
    """A leaf one unit square, over the whole of its atlas."""
    points = np.array([[-0.5, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [-0.5, 1, 0]])
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return LeafPrototype(points, np.tile([0.0, 0.0, 1.0], (4, 1)), uv, faces, np.array([0.3, 0.5, 0.2]), 20.0)


def plain_atlas(rgb: tuple[int, int, int] = (80, 130, 50)) -> Atlas:
    """One opaque colour, worn by square leaves."""
    return Atlas(np.full((8, 8, 4), [*rgb, 255], np.uint8), (square_leaf(),))


def forked_skeleton() -> Skeleton:
    """A trunk of 2 m that forks into two limbs; a thin twig leaves one of them."""
    position = np.array([[0, 0, 0], [0, 1.0, 0], [0, 2.0, 0], [0.8, 3.0, 0], [-0.6, 3.2, 0.4], [1.0, 3.9, 0.6]])
    return Skeleton(position, np.array([-1, 0, 1, 2, 2, 3]), np.array([0.12, 0.11, 0.1, 0.06, 0.06, 0.004]))


def ball_of_leaves(n: int, rng: np.random.Generator) -> Leaves:
    """Leaves in a ball of 1 m about (0.3, 2.9, 0.1), turned anyhow."""
    way = rng.normal(size=(n, 3))
    way *= rng.uniform(0, 1, (n, 1)) ** (1 / 3) / np.linalg.norm(way, axis=1, keepdims=True)
    turn = rng.normal(size=(n, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    return Leaves(way + np.array([0.3, 2.9, 0.1]), turn, rng.uniform(0.08, 0.14, n), np.zeros(n, np.int64))


def forked_tree(n_leaves: int, *, leaves: Leaves | None = None, seed: int = 3) -> TreeModel:
    """A forked tree of 4 m with leaves in a ball."""
    if leaves is None:
        leaves = ball_of_leaves(n_leaves, np.random.default_rng(seed))
    model = tree_model(n_leaves=0)
    skeleton = forked_skeleton()
    return replace(
        model,
        name="forked",
        height=HEIGHT,
        skeleton=skeleton,
        mesh=GeneralisedCylinders()(skeleton, model.bark),
        atlas=plain_atlas() if len(leaves) else model.atlas,
        leaves=leaves,
    )
