"""Leaves that no photo shows: which they are, and that their colours are neither striped nor flat."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from forestgen.tree.foliage_unseen import DRIFT, drift, light, seen_share


def test_the_nearest_leaf_is_seen() -> None:
    pixel = np.array([[0, 1, 2, 3], [0, 1, 5, 6], [2, 3, -1, -1]])
    depth = np.array([0.0, 1.0, 2.0])
    assert_allclose(seen_share(pixel, depth, 8), [0.0, 1.0, 0.5])


def test_drift_is_alike_nearby_and_changes_in_depth() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(0, 10, (3000, 3))
    way = drift(points, 10.0, rng=np.random.default_rng(1))
    assert_allclose(np.std(way, axis=0), DRIFT * 10, rtol=0.35)
    near = drift(points + 0.02, 10.0, rng=np.random.default_rng(1))
    assert np.abs(near - way).max() < 0.3 * DRIFT * 10
    behind = drift(points + np.array([0, 0, 3.0]), 10.0, rng=np.random.default_rng(1))
    assert abs(np.corrcoef(way[:, 0], behind[:, 0])[0, 1]) < 0.7


def test_light_falls_from_above_and_outside() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(20_000, 3))
    points *= rng.uniform(0, 1, (20_000, 1)) ** (1 / 3) / np.linalg.norm(points, axis=1, keepdims=True)
    lit = light(points, np.ones(len(points)), 2.0)
    radius = np.linalg.norm(points, axis=1)
    assert abs(lit).max() < 1
    assert abs(lit.mean()) < 1e-9
    assert lit[radius > 0.9].mean() > lit[radius < 0.4].mean() + 0.4
    assert lit[points[:, 1] > 0.6].mean() > lit[points[:, 1] < -0.6].mean() + 0.3
