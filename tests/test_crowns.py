"""The measure of evenness all round (benchmarks/crowns.py): answers known beforehand."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

from crowns import bare_share, depth, emptiest, foliage_counts

from forestgen.tree.skeleton import Skeleton

STEM = np.array([[0.0, 0, 0], [0, 10, 0]])


def ball_of_points() -> np.ndarray:
    points = np.random.default_rng(0).uniform(-3, 3, (400_000, 3))
    return np.asarray(points[np.linalg.norm(points, axis=1) < 3] + [0, 6, 0])


def test_a_full_ball_is_even_and_as_deep_as_wide() -> None:
    counts = foliage_counts(ball_of_points(), STEM, 10.0)
    assert emptiest(counts) > 0.85
    assert depth(counts) == pytest.approx(1, abs=0.03)


def test_a_wedge_cut_out_toward_the_camera_is_seen() -> None:
    points = ball_of_points()
    angle = np.degrees(np.arctan2(points[:, 2], points[:, 0]))
    counts = foliage_counts(points[np.abs(angle - 90) > 45], STEM, 10.0)
    assert emptiest(counts) < 0.05
    assert depth(counts) == pytest.approx(0.5, abs=0.03)


def test_a_flat_crown_is_not_deep_and_a_leaning_trunk_is_followed() -> None:
    points = ball_of_points() * [1, 1, 0.5]
    straight = depth(foliage_counts(points, STEM, 10.0))
    assert straight < 0.7
    lean = np.array([0.3, 0, 0]) * points[:, 1:2]
    leaning = foliage_counts(points + lean, STEM + np.array([[0, 0, 0], [3, 0, 0]]), 10.0)
    assert depth(leaning) == pytest.approx(straight, abs=0.03)


def test_a_limb_with_leaves_on_its_outer_half_is_half_bare() -> None:
    out = np.linspace(0, 4, 41)[1:]
    stem = np.array([[0.0, 0, 0], [0, 5, 0], [0, 6, 0], [0, 12, 0]])
    limb = np.column_stack([out, np.full(40, 5.0), np.zeros(40)])
    parent = np.array([-1, 0, 1, 2, 1, *range(4, 43)])
    leaves = np.concatenate([limb[20:] + np.array([0, 0.01, 0]), [[0, 4.5, 0.9], [0, 10, 0]]])
    tree = Skeleton(np.concatenate([stem, limb]), parent, np.full(44, 0.1))
    assert bare_share(tree, leaves, 10.0) == pytest.approx((2.0 - 0.3) / 4, abs=0.03)
