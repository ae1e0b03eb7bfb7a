"""Colour models: mixtures of Gaussians over sRGB, for segmentation and for tracing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze

NOISE = 1.5 / 255  # no component is narrower than this in any direction: rounding and JPEG noise
ENOUGH_SAMPLES = 20_000  # a mixture of ten is fitted on no more pixels than this
MAX_STEPS = 30  # of expectation-maximisation; the likelihood rises at each, the last ones change little
LEAST_MASS = 1e-6  # share of the samples below which a component is given up
SETTLED = 1e-3  # nats a pixel: less gain in one step ends the fit


@dataclass(frozen=True, eq=False)
class Mixture:
    """A mixture of K Gaussians over sRGB colours in [0, 1]. Densities are in nats, per unit of [0, 1]^3."""

    weight: NDArray[np.float64]  # (K,) sums to 1
    mean: NDArray[np.float64]  # (K, 3)
    covariance: NDArray[np.float64]  # (K, 3, 3)

    def __post_init__(self) -> None:
        freeze(self, weight=(np.float64, "K"), mean=(np.float64, "K", 3), covariance=(np.float64, "K", 3, 3))
        if not np.isclose(self.weight.sum(), 1):
            raise ValueError(f"the weights of a mixture must add up to 1; came {self.weight.sum()}")

    def __len__(self) -> int:
        return len(self.weight)

    def joint_log_density(self, rgb: NDArray[np.floating]) -> NDArray[np.float32]:
        """log(weight_k * N_k(colour)) of each colour (N, 3) and component: (N, K)."""
        return np.asarray((self._coefficients().astype(np.float32) @ _quadratic_terms(rgb, np.float32)).T)

    def log_density(self, rgb: NDArray[np.floating]) -> NDArray[np.float32]:
        """Log of the mixture's density at each colour of an array (..., 3): (...)."""
        flat = rgb.reshape(-1, 3)
        return log_sum(self.joint_log_density(flat)).reshape(rgb.shape[:-1])

    def subset(self, which: NDArray[Any]) -> Mixture:
        """The mixture of some components (a mask or indices), their weights scaled to add up to 1."""
        weight = self.weight[which]
        if not len(weight):
            raise ValueError("a mixture needs at least one component")
        return Mixture(weight / weight.sum(), self.mean[which], self.covariance[which])

    def _coefficients(self) -> NDArray[np.float64]:
        """Factors (K, 10) of the terms of `_quadratic_terms`."""
        precision = np.linalg.inv(self.covariance)
        mean = self.mean - 0.5
        linear = np.einsum("kij,kj->ki", precision, mean)
        constant = (
            np.log(self.weight)
            - 0.5 * np.linalg.slogdet(2 * np.pi * self.covariance)[1]
            - 0.5 * np.einsum("ki,ki->k", linear, mean)
        )
        square = -0.5 * precision[:, [0, 1, 2], [0, 1, 2]]
        cross = -precision[:, [0, 0, 1], [1, 2, 2]]
        return np.concatenate([constant[:, None], linear, square, cross], axis=1)


def _quadratic_terms(rgb: NDArray[np.floating], kind: type[np.floating]) -> NDArray[Any]:
    """1, x, x^2 and cross terms (10, N) of colours about mid-grey: any log Gaussian is linear in them."""
    x = rgb.T.astype(kind) - kind(0.5)
    terms = np.empty((10, x.shape[1]), kind)
    terms[0] = 1
    terms[1:4] = x
    np.multiply(x, x, out=terms[4:7])
    for row, (i, j) in enumerate(((0, 1), (0, 2), (1, 2)), start=7):
        np.multiply(x[i], x[j], out=terms[row])
    return terms


def log_sum(joint: NDArray[Any]) -> NDArray[Any]:
    """log of the sum of exp over the last axis (fast where that is the outer one in memory)."""
    top = joint.max(axis=-1)
    return np.asarray(top + np.log(np.exp(joint - top[..., None]).sum(axis=-1)))


def fit_mixture(
    rgb: NDArray[np.floating],
    n: int,
    *,
    rng: np.random.Generator,
    weight: NDArray[np.floating] | None = None,
    start: Mixture | None = None,
) -> Mixture:
    """Fit up to n Gaussians to colours (N, 3) in [0, 1], each counting `weight` (N,), by EM.

    Of many colours a subsample is drawn. Begins at `start`, or else at distant samples (k-means++),
    and takes fewer components where there are fewer than ten samples for each.

    Raises:
        ValueError: there is no colour at all.
    """
    if not len(rgb):
        raise ValueError("a mixture needs at least one sample")
    if len(rgb) > ENOUGH_SAMPLES:
        pick = rng.integers(len(rgb), size=ENOUGH_SAMPLES)
        rgb, weight = rgb[pick], None if weight is None else weight[pick]
    x = np.asarray(rgb, np.float64)
    w = np.full(len(x), 1 / len(x)) if weight is None or not weight.sum() > 0 else weight / weight.sum()
    terms, before = _quadratic_terms(x, np.float64), -np.inf
    if start is None:
        seeds = _distant_seeds(x, w, max(1, min(n, len(x) // 10)), rng)
        model = _maximise(terms, w, _nearest_seed(x, seeds))
    else:
        model = start
    for _ in range(MAX_STEPS):
        joint = model._coefficients() @ terms
        total = log_sum(joint.T)
        fit = float(w @ total)
        if fit - before < SETTLED:
            break
        model, before = _maximise(terms, w, np.exp(joint - total)), fit
    return model


def _distant_seeds(
    x: NDArray[np.float64], w: NDArray[np.float64], n: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """n samples (n, 3), each drawn with a chance that grows with the squared distance to those before."""
    seeds = x[[rng.choice(len(x), p=w)]]
    distance = ((x - seeds[0]) ** 2).sum(axis=1)
    while len(seeds) < n:
        chance = w * (distance + NOISE**2)
        seeds = np.vstack([seeds, x[rng.choice(len(x), p=chance / chance.sum())]])
        distance = np.minimum(distance, ((x - seeds[-1]) ** 2).sum(axis=1))
    return np.asarray(seeds)


def _nearest_seed(x: NDArray[np.float64], seeds: NDArray[np.float64]) -> NDArray[np.float64]:
    """One-hot responsibilities (K, N) of the nearest seeds."""
    distance = (seeds**2).sum(axis=1)[:, None] - 2 * seeds @ x.T
    return np.asarray(distance.argmin(axis=0) == np.arange(len(seeds))[:, None], np.float64)


def _maximise(terms: NDArray[np.float64], w: NDArray[np.float64], share: NDArray[np.float64]) -> Mixture:
    """The mixture that fits the responsibilities (K, N) best; components that nothing chose are dropped."""
    moment = (share * w) @ terms.T  # (K, 10): mass, first and second moments about mid-grey
    moment = moment[moment[:, 0] > LEAST_MASS]
    mass = moment[:, 0]
    moment = moment / mass[:, None]
    mean = moment[:, 1:4]
    second = moment[:, [4, 7, 8, 7, 5, 9, 8, 9, 6]].reshape(-1, 3, 3)
    covariance = second - mean[:, :, None] * mean[:, None] + NOISE**2 * np.eye(3)
    return Mixture(mass / mass.sum(), mean + 0.5, covariance)


def component_distance(a: Mixture, b: Mixture) -> NDArray[np.float64]:
    """Bhattacharyya distance of each component of a from each of b: (K_a, K_b), 0 where they coincide."""
    middle = (a.covariance[:, None] + b.covariance[None]) / 2
    apart = a.mean[:, None] - b.mean[None]
    shift = np.einsum("abi,abi->ab", apart, np.linalg.solve(middle, apart[..., None])[..., 0])
    spread = np.linalg.slogdet(middle)[1] - 0.5 * (
        np.linalg.slogdet(a.covariance)[1][:, None] + np.linalg.slogdet(b.covariance)[1][None]
    )
    return np.asarray(shift / 8 + spread / 2)
