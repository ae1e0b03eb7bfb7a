"""Leaves by density: as many as the voxels hold, on wood, over foliage in every view; simple and compound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from forestgen.tree.da_vinci import DaVinci
from forestgen.tree.density import DensityVolume
from forestgen.tree.foliage_crown import Crown
from forestgen.tree.foliage_twigs import young_wood
from forestgen.tree.grow.phyllotaxis import PhyllotaxisTwigs
from forestgen.tree.leaves_by_density import LeavesByDensity, attached, by_density
from forestgen.tree.mattes import Mattes
from forestgen.tree.model import Atlas, LeafPrototype, Leaves
from forestgen.tree.photo import Photo
from forestgen.tree.skeleton import Skeleton, n_children
from forestgen.tree.view import View
from tests.tree.grow.crowns import SIZE, ball_view, two_limbs

CALM = LeavesByDensity(density_resolution=32, layers=2.0, fill_rounds=1)


def blade(*, length: float = 1.0) -> LeafPrototype:
    """A plain rectangle, three tenths as wide as it is long."""
    points = np.array([[-0.15, 0, 0], [0.15, 0, 0], [0.15, length, 0], [-0.15, length, 0]])
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return LeafPrototype(points, np.tile([0.0, 0, 1], (4, 1)), uv, faces, np.array([0.2, 0.45, 0.15]), 12.0)


@pytest.fixture(scope="module")
def atlas() -> Atlas:
    return Atlas(np.full((8, 8, 4), 255, np.uint8), (blade(),))


@pytest.fixture(scope="module")
def views() -> list[View]:
    green = Photo(np.full((*SIZE[::-1], 3), (60, 120, 40), np.uint8), "green.png")
    return [replace(ball_view(azimuth), photo=green) for azimuth in (0.0, np.pi / 2)]


@pytest.fixture(scope="module")
def skeleton(views: list[View]) -> Skeleton:
    lifted = DaVinci()(two_limbs(), views)
    return DaVinci()(PhyllotaxisTwigs(density_resolution=32)(lifted, views, rng=np.random.default_rng(0)), views)


@pytest.fixture(scope="module")
def leaves(skeleton: Skeleton, views: list[View], atlas: Atlas) -> Leaves:
    return CALM(skeleton, views, atlas, rng=np.random.default_rng(1))


def off_wood(skeleton: Skeleton, feet: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far each foot (L,) lies from the bark of the nearest limb, metres."""
    a, b = skeleton.position[skeleton.parent[1:]], skeleton.position[1:]
    along = b - a
    away = np.empty(len(feet))
    for k, foot in enumerate(feet):
        share = np.clip(((foot - a) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12), 0, 1)
        gap = np.linalg.norm(foot - a - share[:, None] * along, axis=1) - skeleton.radius[1:]
        away[k] = gap.min()
    return away


def test_every_leaf_hangs_on_wood(skeleton: Skeleton, leaves: Leaves) -> None:
    assert len(leaves) > 800
    some = leaves.position[:: max(1, len(leaves) // 400)]
    assert off_wood(skeleton, some).max() < 1e-9


def test_leaves_lie_over_foliage_in_every_view(leaves: Leaves, views: list[View]) -> None:
    w, x, y, z = leaves.orientation.T
    axis = np.column_stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)])
    middle = leaves.position + 0.5 * leaves.size[:, None] * axis
    for view in views:
        column, row = np.floor(view.camera.project(middle)).astype(int).T
        assert view.mattes.is_foliage[row, column].mean() > 0.97


def test_the_crown_is_clothed_all_round(leaves: Leaves) -> None:
    azimuth = np.arctan2(leaves.position[:, 0], leaves.position[:, 2])
    count, _ = np.histogram(azimuth, 12, (-np.pi, np.pi))
    assert count.min() > 0.4 * count.mean()


def test_dense_voxels_get_more_leaves(skeleton: Skeleton, views: list[View], atlas: Atlas) -> None:
    alpha = np.zeros((16, 20, 16))
    alpha[:8], alpha[8:] = 0.9, 0.3  # three times as dense on the left
    density = DensityVolume(alpha, np.array([-4.0, 0.0, -4.0]), 0.5)
    crown = Crown(views, skeleton, atlas, CALM.length(skeleton, views))
    wood = young_wood(skeleton)
    rng = np.random.default_rng(2)
    many = CALM.in_voxels(density.sample(6000, rng=rng), wood, crown, rng=rng)
    x = many.position[np.abs(many.position[:, 0]) > 0.3, 0]
    assert 2.2 < np.count_nonzero(x < 0) / np.count_nonzero(x > 0) < 4.2


def test_places_out_of_reach_of_any_twig_get_no_leaf(skeleton: Skeleton) -> None:
    wood = young_wood(skeleton)
    far = np.array([[30.0, 7.0, 0.0], [0.0, 7.0, 0.0]])
    foot, axis, way = attached(far, wood, 0.15, 0.6, 0.25, rng=np.random.default_rng(0))
    assert len(foot) <= 1
    assert (way <= 0.6).all()
    assert np.allclose(np.linalg.norm(axis, axis=1), 1)


def test_tips_are_drawn_by_the_density_of_their_voxels() -> None:
    # 40 tips in a dense voxel, 40 in a thin one, 20 where nothing is
    rng = np.random.default_rng(0)
    place = rng.random((100, 3))
    place[:, 0] += np.repeat([0, 1, 5], [40, 40, 20])
    star = Skeleton(np.vstack([[0, 0, 0], place]), np.array([-1] + [0] * 100), np.full(101, 0.01))
    density = DensityVolume(np.array([0.9, 0.1]).reshape(2, 1, 1), np.zeros(3), 1.0)
    tips = np.arange(1, 101)
    chosen = np.concatenate([by_density(tips, star, density, 20, rng=rng) for _ in range(50)])
    share = [np.mean((chosen > low) & (chosen <= high)) for low, high in ((0, 40), (40, 80), (80, 100))]
    assert share[0] > 0.75
    assert share[1] > 0.08
    assert share[2] == 0
    assert_array_equal(by_density(tips, star, density, 200, rng=rng), tips)


@pytest.mark.parametrize("compound", ["pinnate", "palmate"])
def test_compound_leaves_stand_on_twig_ends(compound: str, skeleton: Skeleton, views: list[View], atlas: Atlas) -> None:
    rule = replace(CALM, compound=compound, leaflets=5, fill_rounds=0, layers=1.0)  # type: ignore[arg-type]
    found = rule(skeleton, views, atlas, rng=np.random.default_rng(1))
    assert len(found) > 300
    assert off_wood(skeleton, found.position[:200]).max() < 1e-9
    tips = skeleton.position[n_children(skeleton.parent) == 0]
    near = np.min([np.linalg.norm(found.position[:200] - tip, axis=1) for tip in tips], axis=0)
    assert np.mean(near < 0.05 + 0.03 * 10) > 0.95


def test_the_same_seed_gives_the_same_leaves(
    skeleton: Skeleton, views: list[View], atlas: Atlas, leaves: Leaves
) -> None:
    again = CALM(skeleton, views, atlas, rng=np.random.default_rng(1))
    assert_array_equal(again.position, leaves.position)
    other = CALM(skeleton, views, atlas, rng=np.random.default_rng(2))
    assert other.position.shape != leaves.position.shape or not np.allclose(other.position, leaves.position)


def test_a_bare_tree_and_an_empty_atlas_bear_no_leaf(skeleton: Skeleton, views: list[View], atlas: Atlas) -> None:
    none = Atlas(atlas.rgba, ())
    assert len(CALM(skeleton, views, none, rng=np.random.default_rng(0))) == 0
    bare = [replace(v, mattes=Mattes(np.zeros_like(v.mattes.foliage), v.mattes.branch)) for v in views]
    assert len(CALM(skeleton, bare, atlas, rng=np.random.default_rng(0))) == 0


@pytest.mark.parametrize("fields", [{"leaflets": 0}, {"leaflet": -1.0}, {"rachis": 0.0}, {"inside": 2.0}])
def test_senseless_parameters_are_refused(fields: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"expected|must be"):
        LeavesByDensity(**fields)  # type: ignore[arg-type]
