"""Flattening: each place's copy lies where the place says, faces outward, and keeps its texture."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.render.drawable import Drawable
from forestgen.tree.joined import joined
from forestgen.usd.flatten import cofactors, flattened
from tests.usd.models import box_mesh


def box(places: np.ndarray) -> Drawable:
    mesh = box_mesh(1.0, 2.0)
    return Drawable(
        name="box", points=mesh.points, faces=mesh.faces, uv=mesh.uv, normals=mesh.normals, transforms=places
    )


def volume(points: np.ndarray, faces: np.ndarray) -> float:
    """Positive where faces look outward."""
    a, b, c = np.moveaxis(points[faces], 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def random_places(n: int) -> np.ndarray:
    rng = np.random.default_rng(3)
    places = np.tile(np.eye(4), (n, 1, 1))
    places[:, :3] = rng.normal(size=(n, 3, 4))
    return places


def test_two_places_by_hand() -> None:
    twice = np.diag([2.0, 2.0, 2.0, 1.0])
    twice[:3, 3] = [10, 0, 0]
    one = Drawable(
        name="leaf",
        points=np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]),
        faces=np.array([[0, 1, 2]]),
        normals=np.tile([0.0, 0.0, 1.0], (3, 1)),
        uv=np.array([[0, 0], [1, 0], [0, 1]]),
        transforms=np.stack([np.eye(4), twice]),
    )
    mesh = flattened(one)
    assert_array_equal(mesh.points, [[0, 0, 0], [1, 0, 0], [0, 1, 0], [10, 0, 0], [12, 0, 0], [10, 2, 0]])
    assert_array_equal(mesh.faces, [[0, 1, 2], [3, 4, 5]])
    assert_array_equal(mesh.normals, np.tile([0.0, 0.0, 1.0], (6, 1)))
    assert_array_equal(mesh.uv, [[0, 0], [1, 0], [0, 1]] * 2)


def test_all_places_at_once_are_the_places_one_by_one() -> None:
    places = random_places(20)
    mesh = flattened(box(places))
    single = [flattened(box(place[None])) for place in places]
    assert_allclose(mesh.points, np.concatenate([one.points for one in single]), atol=1e-12)
    assert_allclose(mesh.normals, np.concatenate([one.normals for one in single]), atol=1e-12)
    assert_array_equal(mesh.faces, np.concatenate([one.faces + 8 * k for k, one in enumerate(single)]))
    for place, one in zip(places, single, strict=True):
        assert_allclose(one.points, box_mesh(1.0, 2.0).points @ place[:3, :3].T + place[:3, 3], atol=1e-12)


def test_faces_look_outward_wherever_they_stand_mirrored_or_not() -> None:
    places = random_places(40)
    turned = np.linalg.det(places[:, :3, :3])
    assert (turned < 0).any()
    assert (turned > 0).any()
    mesh = flattened(box(places))
    for k in range(40):
        part = slice(12 * k, 12 * (k + 1))
        assert volume(mesh.points, mesh.faces[part]) == pytest.approx(2 * abs(turned[k]), rel=1e-9)
        middle = mesh.points[8 * k : 8 * k + 8].mean(axis=0)
        # the box's normals lean outward from its middle; so must the moved ones
        outward = mesh.points[8 * k : 8 * k + 8] - middle
        assert (np.einsum("ij,ij->i", outward, mesh.normals[8 * k : 8 * k + 8]) > 0).all()


def test_normals_stay_square_to_a_plane_that_is_squeezed_and_sheared() -> None:
    rng = np.random.default_rng(5)
    matrix = rng.normal(size=(30, 3, 3))
    a, b = rng.normal(size=(2, 30, 3))
    normal = np.cross(a, b)
    moved = np.einsum("kij,kj->ki", cofactors(matrix), normal)
    assert_allclose(np.einsum("ki,kij,kj->k", moved, matrix, a), 0, atol=1e-10)
    assert_allclose(np.einsum("ki,kij,kj->k", moved, matrix, b), 0, atol=1e-10)
    inverse = np.linalg.inv(matrix).transpose(0, 2, 1) * np.abs(np.linalg.det(matrix))[:, None, None]
    assert_allclose(cofactors(matrix), inverse, atol=1e-9)


def test_a_place_squeezed_to_nothing_gives_finite_unit_normals() -> None:
    flat = np.diag([1.0, 1.0, 0.0, 1.0])[None]
    mesh = flattened(box(flat))
    assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1)
    assert_array_equal(mesh.points[:, 2], 0)


def test_joined_meshes_keep_every_corner() -> None:
    parts = [box_mesh(1, 1), box_mesh(2, 3), box_mesh(4, 1)]
    mesh = joined(parts)
    assert_array_equal(mesh.points[mesh.faces], np.concatenate([part.points[part.faces] for part in parts]))
    assert_array_equal(mesh.uv[mesh.faces], np.concatenate([part.uv[part.faces] for part in parts]))
    assert_array_equal(mesh.normals[mesh.faces], np.concatenate([part.normals[part.faces] for part in parts]))


def test_nothing_cannot_be_joined() -> None:
    with pytest.raises(ValueError, match="no mesh"):
        joined([])
