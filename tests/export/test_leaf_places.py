"""Leaves as one mesh: each corner stands where the leaf's own rotation puts it."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from forestgen.export.leaf_places import by_prototype, flat_leaves
from forestgen.tree.model import Leaves
from tests.usd.models import leaf_prototype, random_leaves


def test_one_leaf_by_hand() -> None:
    """Turned a quarter about +Z, the blade that pointed up points to -X."""
    quarter = np.array([[np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]])
    leaf = Leaves(np.array([[1.0, 2.0, 3.0]]), quarter, np.array([2.0]), np.array([0]))
    flat = flat_leaves(leaf, [leaf_prototype(0, 1)])
    assert_allclose(flat.points[2], [1 - 2.0, 2.0, 3.0 + 0.1], atol=1e-12)
    assert_allclose(flat.normals, [[0, 0, 1]] * 3, atol=1e-12)


def test_each_corner_is_where_scipy_puts_it() -> None:
    leaves, prototypes = random_leaves(40, 3, np.random.default_rng(1)), [leaf_prototype(k, 4) for k in range(4)]
    flat = flat_leaves(leaves, prototypes)
    turn = Rotation.from_quat(leaves.orientation[:, [1, 2, 3, 0]])
    order = [k for chosen in by_prototype(leaves, 4) for k in chosen]
    plain = [
        turn[k].apply(prototypes[leaves.prototype[k]].points.copy()) * leaves.size[k] + leaves.position[k]
        for k in order
    ]
    assert_allclose(flat.points, np.concatenate(plain), atol=1e-12)
    assert_array_equal(flat.faces, np.arange(120).reshape(40, 3))
    assert_array_equal(flat.uv, np.concatenate([prototypes[leaves.prototype[k]].uv for k in order]))


def test_every_leaf_is_in_one_group() -> None:
    leaves = random_leaves(30, 2, np.random.default_rng(2))
    groups = by_prototype(leaves, 4)
    assert [len(group) for group in groups] == np.bincount(leaves.prototype, minlength=4).tolist()
    assert sorted(np.concatenate(groups)) == list(range(30))
    assert all((leaves.prototype[group] == k).all() for k, group in enumerate(groups))
