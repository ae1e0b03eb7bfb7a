"""Mesh, leaves, atlas and tree: indices in range, unit quaternions."""

from __future__ import annotations

import numpy as np
import pytest

from forestgen.tree.model import Atlas, Bark, LeafPrototype, Leaves, Mesh, TreeModel
from forestgen.tree.skeleton import Skeleton

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
UP = np.tile([0.0, 0.0, 1.0], (3, 1))
FACE = np.array([[0, 1, 2]])
NOBODY = np.zeros((0, 3))


def mesh(faces: np.ndarray = FACE) -> Mesh:
    return Mesh(TRIANGLE, UP, TRIANGLE[:, :2], faces)


def leaves(prototype: list[int], orientation: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)) -> Leaves:
    n = len(prototype)
    return Leaves(np.zeros((n, 3)), np.tile(orientation, (n, 1)), np.ones(n), np.array(prototype, np.int64))


def tree(prototype: list[int]) -> TreeModel:
    leaf = LeafPrototype(TRIANGLE, UP, TRIANGLE[:, :2], FACE, np.zeros(3), 12.0)
    return TreeModel(
        name="tree",
        method="tan2008",
        seed=0,
        height=5.0,
        views=(),
        skeleton=Skeleton([[0, 0, 0]], [-1], [0.1]),  # type: ignore[arg-type]
        mesh=mesh(),
        bark=Bark(np.zeros((1, 1, 3)), 1.0, 1.0),  # type: ignore[arg-type]
        atlas=Atlas(np.zeros((4, 4, 4)), (leaf, leaf)),  # type: ignore[arg-type]
        leaves=leaves(prototype),
    )


@pytest.mark.parametrize("faces", [[[0, 1, 3]], [[0, 1, -1]]])
def test_faces_point_into_the_mesh(faces: list[list[int]]) -> None:
    with pytest.raises(ValueError, match=r"Mesh\.faces points outside"):
        mesh(np.array(faces))


def test_a_mesh_may_be_empty() -> None:
    assert Mesh(NOBODY, NOBODY, NOBODY[:, :2], np.zeros((0, 3), np.int64)).points.shape == (0, 3)


def test_leaves_stand_by_unit_quaternions() -> None:
    assert len(leaves([0, 1])) == 2
    assert len(leaves([])) == 0
    with pytest.raises(ValueError, match="unit quaternions"):
        leaves([0], (1.0, 0.5, 0.0, 0.0))


def test_leaves_take_prototypes_of_the_atlas() -> None:
    assert len(tree([0, 1, 1]).leaves) == 3
    assert len(tree([]).leaves) == 0
    with pytest.raises(ValueError, match="outside the atlas"):
        tree([0, 2])
