"""Places of leaves, of trees, of leaves on trees; and leaves as one mesh."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from forestgen.export.places import Places, hamilton, leaf_places, standing_places
from forestgen.scene.forest import Forest
from forestgen.tree.model import Leaves
from forestgen.usd.flatten import flat_leaves
from tests.usd.models import leaf_prototype, random_leaves


def random_places(n: int, rng: np.random.Generator) -> Places:
    turn = rng.normal(size=(n, 4))
    return Places(rng.normal(size=(n, 3)), turn / np.linalg.norm(turn, axis=1, keepdims=True), rng.uniform(0.1, 2, n))


def test_one_leaf_by_hand() -> None:
    """Turned a quarter about +Z, the blade that pointed up points to -X."""
    quarter = np.array([[np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]])
    leaf = Leaves(np.array([[1.0, 2.0, 3.0]]), quarter, np.array([2.0]), np.array([0]))
    flat, _ = flat_leaves(leaf, [leaf_prototype(0, 1)])
    assert_allclose(flat.points[2], [1 - 2.0, 2.0, 3.0 + 0.1], atol=1e-12)
    assert_allclose(flat.normals, [[0, 0, 1]] * 3, atol=1e-12)


def test_each_corner_is_where_scipy_puts_it() -> None:
    leaves, prototypes = random_leaves(40, 3, np.random.default_rng(1)), [leaf_prototype(k, 4) for k in range(4)]
    flat, _ = flat_leaves(leaves, prototypes)
    turn = Rotation.from_quat(leaves.orientation[:, [1, 2, 3, 0]])
    order = np.argsort(leaves.prototype, kind="stable")
    plain = [
        turn[k].apply(prototypes[leaves.prototype[k]].points.copy()) * leaves.size[k] + leaves.position[k]
        for k in order
    ]
    assert_allclose(flat.points, np.concatenate(plain), atol=1e-12)
    assert_array_equal(flat.faces, np.arange(120).reshape(40, 3))
    assert_array_equal(flat.uv, np.concatenate([prototypes[leaves.prototype[k]].uv for k in order]))


def test_every_leaf_has_its_place_with_its_prototype() -> None:
    leaves = random_leaves(30, 2, np.random.default_rng(2))
    for k, places in enumerate(leaf_places(leaves, 4)):
        chosen = leaves.prototype == k
        assert_array_equal(places.position, leaves.position[chosen])
        assert_array_equal(places.turn, leaves.orientation[chosen][:, [1, 2, 3, 0]])
        assert_array_equal(places.size, leaves.size[chosen])


def test_quaternions_multiply_as_scipys() -> None:
    a, b = (random_places(20, np.random.default_rng(k)).turn for k in (3, 4))
    product = (Rotation.from_quat(a) * Rotation.from_quat(b)).as_quat()
    assert_allclose(hamilton(a, b) * np.sign(hamilton(a, b)[:, 3:]), product * np.sign(product[:, 3:]), atol=1e-12)


def test_places_within_places_multiply_as_matrices() -> None:
    rng = np.random.default_rng(5)
    outer, inner = random_places(4, rng), random_places(7, rng)
    assert_allclose(outer.of(inner).matrix(), (outer.matrix()[:, None] @ inner.matrix()).reshape(-1, 4, 4), atol=1e-12)


def test_trees_stand_by_their_kind() -> None:
    """Turned by their heading about +Y: what faced +Z faces +X at 90 degrees."""
    forest = Forest(
        prototypes=("oak", "elm"),
        names=("a", "b", "c"),
        prototype=np.array([1, 0, 1]),
        position=np.arange(9.0).reshape(3, 3),
        yaw=np.radians([0, 30, 90]),
        scale=np.array([1, 2, 0.5]),
    )
    oak, elm = standing_places(forest)
    assert_array_equal(oak.position, [[3, 4, 5]])
    assert_array_equal(elm.size, [1, 0.5])
    assert_allclose(elm.matrix()[1] @ [0, 0, 1, 1], [6.5, 7, 8, 1], atol=1e-12)
