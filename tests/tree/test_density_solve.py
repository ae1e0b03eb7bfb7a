"""Both solvers against what is known of their solutions."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import nnls
from scipy.sparse import csr_array

from forestgen.errors import StageError
from forestgen.tree import density_solve
from forestgen.tree.density_solve import least_squares, most_even


def test_the_most_even_solution_keeps_the_guesses_proportions() -> None:
    one_ray = csr_array(np.array([[1.0, 1.0]]))
    assert_allclose(most_even(one_ray, np.array([8.0]), np.array([1.0, 3.0])), [2, 6], rtol=1e-3)


def test_the_most_even_solution_of_two_views_is_their_product() -> None:
    # four voxels, rows seen as 1 and 3, columns as 2 and 2: of all that fit, the one of most entropy is separable
    rays = csr_array(np.array([[1, 1, 0, 0], [0, 0, 1, 1], [1, 0, 1, 0], [0, 1, 0, 1]], float))
    depth = most_even(rays, np.array([1.0, 3.0, 2.0, 2.0]), np.ones(4))
    assert_allclose(depth, [0.5, 0.5, 1.5, 1.5], atol=0.01)


def test_the_least_squares_solution_is_as_good_as_a_dense_solver() -> None:
    rng = np.random.default_rng(5)
    dense = (rng.random((30, 12)) < 0.4) * rng.random((30, 12)) + 0.01
    truth = np.maximum(rng.normal(size=12), 0)
    exact, residual = nnls(dense, dense @ truth)
    assert residual < 1e-8
    found = least_squares(csr_array(dense), dense @ truth, np.full(12, 0.5))
    assert (found >= 0).all()
    assert np.linalg.norm(dense @ found - dense @ exact) < 0.05 * np.linalg.norm(dense @ exact)


def test_clear_rays_empty_their_voxels() -> None:
    rays = csr_array(np.array([[1.0, 1.0], [0.0, 1.0]]))
    for solve in (least_squares, most_even):
        depth = solve(rays, np.array([2.0, 0.0]), np.ones(2))
        assert_allclose(depth, [2, 0], atol=0.1)


def test_a_solver_that_does_not_settle_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(density_solve, "STEPS", 1)
    rays = csr_array(np.array([[1.0, 1.0], [0.0, 1.0]]))
    for solve in (least_squares, most_even):
        with pytest.raises(StageError, match="did not settle in 1 steps; misfit"):
            solve(rays, np.array([2.0, 0.0]), np.ones(2))
