"""The density volume: where its voxels lie, and points drawn from it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.tree.density import DensityVolume


def two_voxels() -> DensityVolume:
    """One of 0.25 at the origin's corner, and one of 0.75 three voxels on along z; edges of 2 m."""
    alpha = np.zeros((1, 2, 4))
    alpha[0, 0, 0], alpha[0, 1, 3] = 0.25, 0.75
    return DensityVolume(alpha, np.array([-1.0, 0.0, -4.0]), 2.0)


def test_centres_come_in_the_order_of_the_voxels() -> None:
    volume = two_voxels()
    assert_allclose(volume.at(volume.centres()), volume.alpha.ravel())
    assert_allclose(volume.centres(volume.is_filled), [[0, 1, -3], [0, 3, 3]])


def test_outside_the_grid_it_is_empty() -> None:
    assert_allclose(
        two_voxels().at(np.array([[0, 1, -4.1], [0, 1, -3.9], [0, -0.1, -3], [1.1, 3, 3]])), [0, 0.25, 0, 0]
    )


def test_points_are_drawn_in_proportion_to_density() -> None:
    volume = two_voxels()
    points = volume.sample(4000, rng=np.random.default_rng(3))
    found = volume.at(points)
    assert (found > 0).all()
    assert np.mean(found == 0.75) == pytest.approx(0.75, abs=0.02)
    near = points[found == 0.25] - [0, 1, -3]
    assert np.abs(near).max() <= 1
    assert_allclose(near.mean(axis=0), 0, atol=0.1)


def test_an_empty_volume_gives_no_points() -> None:
    with pytest.raises(ValueError, match="every voxel is empty"):
        DensityVolume(np.zeros((2, 2, 2)), np.zeros(3), 1.0).sample(5, rng=np.random.default_rng(0))


def test_bad_values_are_refused() -> None:
    with pytest.raises(ValueError, match=r"must lie in \[0, 1\]; came 0.0 to 1.5"):
        DensityVolume(np.array([[[0.0, 1.5]]]), np.zeros(3), 1.0)
    with pytest.raises(ValueError, match="edge is 0"):
        DensityVolume(np.zeros((1, 1, 1)), np.zeros(3), 0.0)
