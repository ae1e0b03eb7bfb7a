"""Coarse squares of a photo, and eq. 1 of Neubert 2007 along their rays."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.camera import Camera
from forestgen.tree.density import DensityVolume
from forestgen.tree.density_rays import OPAQUE, optical_depth, rasterise, ray_matrix


def along_z() -> DensityVolume:
    """Two voxels of 1 m, opacities 0.5 and 0.2, one behind the other for the front camera."""
    return DensityVolume(np.array([[[0.5, 0.2]], [[0.0, 0.0]]]), np.array([-1.0, 0.0, -1.0]), 1.0)


def coverage(volume: DensityVolume, camera: Camera) -> np.ndarray:
    raster = rasterise(np.zeros(camera.size[::-1]), camera, volume)
    depth = ray_matrix(raster, volume.centres()) @ optical_depth(volume.alpha.ravel())
    return (1 - np.exp(-depth)).reshape(raster.value.shape)


def test_transparencies_multiply_along_a_ray() -> None:
    front = coverage(along_z(), Camera((40, 40), (20.0, 30.0), 10.0))
    assert_allclose(front[front > 0], 1 - 0.5 * 0.8)
    side = coverage(along_z(), Camera((40, 40), (20.0, 30.0), 10.0, np.pi / 2))
    assert_allclose(side[side > 0], [0.2, 0.5])  # seen from +X, what is nearer to the front camera lies left


def test_oblique_views_see_as_much_depth_in_all() -> None:
    total = optical_depth(along_z().alpha).sum()
    for azimuth, elevation in ((0.3, 0.0), (np.pi / 4, 0.4)):
        camera = Camera((60, 60), (30.0, 40.0), 10.0, azimuth, elevation)
        assert optical_depth(coverage(along_z(), camera)).sum() == pytest.approx(total)


def test_what_is_nearer_to_a_perspective_camera_looks_larger() -> None:
    camera = Camera((60, 60), (30.0, 30.0), 10.0, focal_px=100.0)  # 10 m away
    grid = DensityVolume(np.zeros((1, 1, 1)), np.array([-0.5, 0.0, 1.5]), 1.0)
    rays = ray_matrix(rasterise(np.zeros((60, 60)), camera, grid), grid.centres())
    assert rays.sum() == pytest.approx((10 / 8) ** 2)


def test_squares_hold_the_mean_of_their_pixels() -> None:
    grid = DensityVolume(np.zeros((2, 2, 2)), np.array([-1.0, 0.0, -1.0]), 1.0)
    image = np.arange(16, dtype=float).reshape(4, 4)
    raster = rasterise(image, Camera((4, 4), (2.0, 4.0), 2.0), grid)
    assert raster.square == 2
    assert_allclose(raster.value[-2:, -2:], [[2.5, 4.5], [10.5, 12.5]])
    assert_allclose(raster.at(np.array([[-0.5, 1.5, 9.0], [0.5, 0.5, 0.0], [50, 0, 0]])), [2.5, 12.5, 0])


def test_parts_of_pixels_count_in_proportion() -> None:
    grid = DensityVolume(np.zeros((1, 1, 1)), np.array([-0.75, 0.0, -0.75]), 1.5)
    image = np.array([[0.0, 1.0, 1.0, 0.0]] * 3)
    raster = rasterise(image, Camera((4, 3), (1.75, 3.0), 1.0), grid)  # squares of 1.5 px from 1.0 to 2.5 to 4
    row = raster.value[-1]
    assert row.sum() * 1.5 == pytest.approx(2.0)
    assert_allclose(raster.at(np.array([[0, 0.5, 0]])), 1.0)
    assert_allclose(raster.at(np.array([[1.5, 0.5, 0]])), 1 / 3)


def test_an_opaque_square_has_a_finite_depth() -> None:
    assert_allclose(optical_depth(np.array([0.0, 0.5, OPAQUE, 1.0])), [0, np.log(2), -np.log(0.02), -np.log(0.02)])
