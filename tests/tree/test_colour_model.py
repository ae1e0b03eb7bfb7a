"""Mixtures of Gaussians: densities, fits of known mixtures, distances."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from forestgen.tree.colour_model import NOISE, Mixture, component_distance, fit_mixture, log_sum


def two_colours() -> Mixture:
    return Mixture(
        np.array([0.3, 0.7]),
        np.array([[0.2, 0.5, 0.1], [0.6, 0.7, 0.9]]),
        np.array([np.diag([0.002, 0.003, 0.001]), [[0.004, 0.002, 0], [0.002, 0.003, 0.001], [0, 0.001, 0.002]]]),
    )


def sample(model: Mixture, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    which = rng.choice(len(model), n, p=model.weight)
    return np.array([rng.multivariate_normal(model.mean[k], model.covariance[k]) for k in which])


def test_density_is_that_of_scipy() -> None:
    model, colour = two_colours(), np.random.default_rng(0).random((4, 5, 3))
    parts = [
        w * multivariate_normal(m, c).pdf(colour)
        for w, m, c in zip(model.weight, model.mean, model.covariance, strict=True)
    ]
    assert model.log_density(colour).shape == (4, 5)
    assert_allclose(model.log_density(colour), np.log(sum(parts)), rtol=2e-4, atol=2e-3)
    assert_allclose(np.exp(model.joint_log_density(colour[0])), np.stack(parts, axis=-1)[0], rtol=1e-2, atol=1e-8)


def test_fit_recovers_a_known_mixture() -> None:
    truth = two_colours()
    rng = np.random.default_rng(1)
    found = fit_mixture(sample(truth, 6000, rng), 2, rng=rng)
    order = np.argsort(found.mean[:, 0])
    assert_allclose(found.weight[order], truth.weight, atol=0.03)
    assert_allclose(found.mean[order], truth.mean, atol=0.01)
    assert_allclose(found.covariance[order], truth.covariance, atol=6e-4)


def test_fit_explains_samples_as_well_as_sklearn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOKY_MAX_CPU_COUNT", "1")  # where cores cannot be counted, joblib warns
    sklearn = pytest.importorskip("sklearn.mixture")
    rng = np.random.default_rng(2)
    x = np.clip(np.concatenate([rng.normal(m, 0.05, (500, 3)) for m in rng.random((8, 3))]), 0, 1)
    ours = float(fit_mixture(x, 8, rng=rng).log_density(x).mean())
    peer = sklearn.GaussianMixture(8, random_state=0, reg_covar=NOISE**2).fit(x)
    assert ours > peer.score(x) - 0.1


def test_weights_of_samples_count() -> None:
    rng = np.random.default_rng(3)
    x = np.concatenate([rng.normal(0.2, 0.02, (500, 3)), rng.normal(0.8, 0.02, (500, 3))])
    model = fit_mixture(x, 1, rng=rng, weight=np.repeat([1.0, 0.0], 500))
    assert_allclose(model.mean, 0.2, atol=0.01)


def test_one_colour_gets_the_spread_of_noise() -> None:
    model = fit_mixture(np.full((100, 3), 0.5), 5, rng=np.random.default_rng(0))
    assert np.isfinite(model.log_density(np.full((1, 3), 0.5))).all()
    assert_allclose(model.covariance, NOISE**2 * np.eye(3)[None].repeat(len(model), 0), atol=1e-9)


def test_few_samples_get_few_components() -> None:
    rng = np.random.default_rng(4)
    assert len(fit_mixture(rng.random((25, 3)), 10, rng=rng)) <= 2
    assert len(fit_mixture(rng.random((1, 3)), 10, rng=rng)) == 1
    with pytest.raises(ValueError, match="at least one sample"):
        fit_mixture(np.empty((0, 3)), 3, rng=rng)


def test_same_seed_same_mixture() -> None:
    x = np.random.default_rng(5).random((30_000, 3))
    a, b = (fit_mixture(x, 6, rng=np.random.default_rng(7)) for _ in range(2))
    assert_array_equal(a.mean, b.mean)
    assert_array_equal(a.covariance, b.covariance)


def test_a_start_is_improved_upon() -> None:
    truth, rng = two_colours(), np.random.default_rng(6)
    x = sample(truth, 2000, rng)
    start = Mixture(np.array([0.5, 0.5]), truth.mean + 0.05, truth.covariance * 2)
    better = fit_mixture(x, 2, rng=rng, start=start)
    assert better.log_density(x).mean() > start.log_density(x).mean()


def test_subset_is_scaled_to_one() -> None:
    part = two_colours().subset(np.array([False, True]))
    assert_array_equal(part.weight, [1])
    with pytest.raises(ValueError, match="at least one component"):
        two_colours().subset(np.array([False, False]))
    with pytest.raises(ValueError, match="add up to 1"):
        Mixture(np.array([0.5]), np.zeros((1, 3)), np.eye(3)[None])


def test_component_distance_by_hand() -> None:
    # equal covariances C: the distance is |m1 - m2|^2 / (8 C); equal means, C and 4C: 1.5 log(2.5 / 2)
    unit = np.array([np.eye(3)])
    a = Mixture(np.ones(1), np.zeros((1, 3)), 0.01 * unit)
    b = Mixture(np.ones(1), np.array([[0.2, 0, 0]]), 0.01 * unit)
    c = Mixture(np.ones(1), np.zeros((1, 3)), 0.04 * unit)
    assert_allclose(component_distance(a, a), [[0]], atol=1e-12)
    assert_allclose(component_distance(a, b), [[0.04 / 0.08]])
    assert_allclose(component_distance(a, c), [[1.5 * np.log(2.5 / 2)]])


def test_log_sum_does_not_overflow() -> None:
    assert_allclose(log_sum(np.array([[1000.0, 1000.0], [-2000.0, -2000.0]])), [1000 + np.log(2), -2000 + np.log(2)])
