"""Normalized matting: eq. 3 by hand, beside a general solver, and NormalizedMatte on drawn trees of known mattes."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.optimize import minimize

from forestgen.errors import StageError
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.segment.laplacian import MattingLaplacian, matting_laplacian
from forestgen.tree.segment.matte_multigrid import approximate_inverse
from forestgen.tree.segment.matte_pyramid import halved, normalized_alpha
from forestgen.tree.segment.matte_ratio import Criterion, minimise
from forestgen.tree.segment.normalized_matte import NormalizedMatte
from tests.tree.segment import scenes

T, B, U = 1.0, 0.0, 0.5


def dense(rgb: NDArray[np.float64], radius: int, epsilon: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The oracle: A and D of Levin et al. 2008, eq. 12, summed window by window."""
    h, w, _ = rgb.shape
    index, side = np.arange(h * w).reshape(h, w), 2 * radius + 1
    affinity, degree = np.zeros((h * w, h * w)), np.zeros(h * w)
    for row in range(h - side + 1):
        for column in range(w - side + 1):
            at = index[row : row + side, column : column + side].ravel()
            away = rgb.reshape(-1, 3)[at] - rgb.reshape(-1, 3)[at].mean(axis=0)
            spread = np.linalg.inv(away.T @ away / side**2 + epsilon / side**2 * np.eye(3))
            affinity[np.ix_(at, at)] += (1 + away @ spread @ away.T) / side**2
            degree[at] += 1
    return affinity, degree


def places(laplacian: MattingLaplacian, mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.flatnonzero(laplacian.pad(mask))


def criterion_of(rgb: NDArray[np.float64], trimap: NDArray[np.float64], pull: float = 0.0) -> Criterion:
    laplacian = matting_laplacian(rgb, 1, 1e-4)
    everywhere = places(laplacian, np.ones(trimap.shape, bool))
    return Criterion(laplacian, everywhere, places(laplacian, trimap == U), laplacian.pad(trimap), pull)


@pytest.mark.parametrize("radius", [1, 2])
def test_the_laplacian_is_the_windows_sum(radius: int) -> None:
    rng = np.random.default_rng(3)
    rgb, alpha = rng.random((9, 8, 3)), rng.random((9, 8))
    affinity, degree = dense(rgb, radius, 1e-3)
    laplacian = matting_laplacian(rgb, radius, 1e-3)
    at = places(laplacian, np.ones((9, 8), bool))
    assert_allclose(laplacian.degree[at], degree)
    assert_allclose(affinity.sum(axis=1), degree, atol=1e-12)  # D_ii = sum_j A_ij
    assert_allclose(laplacian.times(laplacian.pad(alpha), at), degree * alpha.ravel() - affinity @ alpha.ravel())
    assert_allclose(laplacian.diagonal(at), degree - affinity.diagonal())
    assert_array_equal(laplacian.crop(laplacian.pad(alpha)), alpha)


def test_equation_3_by_hand() -> None:
    # One window of one colour: A_ij = 1/9, D_ii = 1. Three white pixels of nine: the cut is
    # 3 * 6 / 9 = 2 (eq. 2), the volume 3.
    criterion = criterion_of(np.full((3, 3, 3), 0.5), np.full((3, 3), U))
    alpha = criterion.laplacian.pad(np.array([[T, T, T], [B, B, B], [B, B, B]]))
    assert_allclose(criterion.value(alpha), 2 / 3)
    assert_allclose(criterion.value(criterion.laplacian.pad(np.ones((3, 3)))), 0, atol=1e-15)
    half = alpha / 2  # scaling alpha changes nothing: w in eq. 4 has length 1
    assert_allclose(criterion.value(half), 2 / 3)


def test_the_gradient_is_the_differences() -> None:
    rng = np.random.default_rng(5)
    trimap = rng.choice([T, B, U], (6, 7))
    criterion = criterion_of(rng.random((6, 7, 3)), trimap, pull=0.3)
    alpha = criterion.laplacian.pad(rng.random((6, 7)))
    ratio = criterion.value(alpha)
    found = 2 * criterion.gradient(alpha, ratio) / criterion.volume(alpha)
    for place, slope in zip(criterion.unknown, found, strict=True):
        ends = []
        for step in (1e-6, -1e-6):
            moved = alpha.copy()
            moved[place] += step
            ends.append(criterion.value(moved))
        assert_allclose(slope, (ends[0] - ends[1]) / 2e-6, atol=1e-7)


def test_the_multigrid_is_symmetric_and_near_the_inverse() -> None:
    rng = np.random.default_rng(6)
    laplacian = matting_laplacian(rng.random((12, 15, 3)) * 0.05, 1, 1e-3)
    free = places(laplacian, rng.random((12, 15)) < 0.8)
    inverse = approximate_inverse(laplacian, free, 0.01)
    system, field = np.empty((len(free), len(free))), np.zeros(len(laplacian.degree))
    for k, place in enumerate(free):
        field[place] = 1
        system[k] = laplacian.times(field, free)
        field[place] = 0
    system += 0.01 * np.eye(len(free))
    found = np.stack([inverse(row) for row in np.eye(len(free))])
    assert_allclose(found, found.T, atol=1e-9 * np.abs(found).max())
    values = np.linalg.eigvals(found @ system).real
    assert values.min() > 0.05
    assert values.max() < 2


def two_regions(noise: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """A picture (15, 20, 3), a few scribbles and the truth: a bar that leans on a bright ground."""
    rng = np.random.default_rng(2)
    y, x = np.mgrid[:15, :20]
    alpha = np.clip(3.5 - np.abs(x - 9 - y / 4), 0, 1)
    shade = 0.1 * np.stack([y / 15, x / 20, x * y / 300], axis=2)
    rgb = alpha[..., None] * (np.array([0.3, 0.2, 0.1]) + shade) + (1 - alpha[..., None]) * (
        np.array([0.6, 0.7, 0.9]) - shade
    )
    trimap = np.full(alpha.shape, U)
    trimap[4:11, 11], trimap[2:5, 2], trimap[10:13, 18] = T, B, B
    return np.clip(rgb + rng.normal(0, noise, rgb.shape), 0, 1), trimap, alpha


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_general_solver_finds_nothing_lower(noise: float) -> None:
    """The paper's way (fmincon's SQP) on a picture that it can hold."""
    rgb, trimap, _ = two_regions(noise)
    alpha, found = normalized_alpha(rgb, trimap, tolerance=1e-4)
    assert found.is_converged
    affinity, degree = dense(rgb, 1, 1e-4)
    is_unknown = (trimap == U).ravel()

    def ratio(unknown: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        full = trimap.ravel().copy()
        full[is_unknown] = unknown
        cut, volume = degree * full - affinity @ full, degree * full
        value = float(full @ cut / (full @ volume))
        return value, (2 * (cut - value * volume) / (full @ volume))[is_unknown]

    assert_allclose(
        ratio(alpha.ravel()[is_unknown])[0], found.ratio, atol=1e-15 * degree.sum()
    )  # the oracle subtracts numbers near 9
    start = np.full(int(is_unknown.sum()), U)
    bounds = [(0.0, 1.0)] * len(start)
    general = minimize(ratio, start, jac=True, method="SLSQP", bounds=bounds, options={"maxiter": 300, "ftol": 1e-12})
    assert found.ratio <= general.fun * (1 + 1e-4)


def test_bounds_and_scribbles_hold() -> None:
    rgb, trimap, _ = two_regions(0.1)
    alpha, _ = normalized_alpha(rgb, trimap)
    assert alpha.min() >= 0
    assert alpha.max() <= 1
    assert_array_equal(alpha[trimap != U], trimap[trimap != U])


def test_the_same_picture_gives_the_same_bytes() -> None:
    rgb, trimap, _ = two_regions(0.1)
    first, second = (normalized_alpha(rgb, trimap)[0] for _ in range(2))
    assert first.tobytes() == second.tobytes()


def test_two_plain_regions_are_told_apart_from_three_scribbles() -> None:
    rgb, trimap, truth = two_regions(0.0)
    alpha, _ = normalized_alpha(rgb, trimap)
    assert np.abs(alpha - truth).max() < 0.1


def test_each_round_lowers_the_ratio() -> None:
    rgb, trimap, _ = two_regions(0.05)
    criterion = criterion_of(rgb, trimap)
    start = criterion.laplacian.pad(trimap)
    ratios = [minimise(criterion, start, 1e-6, steps).ratio for steps in (1, 5, 20, 100, 1000)]
    assert (np.diff(ratios) <= 0).all()
    assert ratios[0] < criterion.value(start)


def test_a_strong_pull_gives_what_is_nearby() -> None:
    rgb, trimap, _ = two_regions(0.02)
    nearby = np.random.default_rng(1).random(trimap.shape)
    alpha, _ = normalized_alpha(rgb, trimap, nearby=nearby, pull=1e6, tolerance=1e-6)
    assert_allclose(alpha, np.where(trimap == U, nearby, trimap), atol=1e-4)


def test_a_gap_that_no_scribble_reaches_becomes_foreground() -> None:
    """What the criterion wants, and why the stage never leaves a gap to it."""
    rgb = np.full((12, 24, 3), 0.8)
    rgb[:, 6:9] = rgb[:, 17:20] = 0.2  # two trunks; sky left, between and right
    trimap = np.full((12, 24), U)
    trimap[:, 7], trimap[:, 18] = T, T
    trimap[:, 0], trimap[:, 23] = B, B
    alpha, _ = normalized_alpha(rgb, trimap, tolerance=1e-4)
    assert alpha[:, 10:16].min() > 0.9
    assert alpha[:, :4].max() < 0.1


def test_a_solver_that_does_not_converge_says_so_with_its_residual(caplog: pytest.LogCaptureFixture) -> None:
    rgb, trimap, _ = two_regions(0.1)
    with caplog.at_level(logging.WARNING):
        alpha, found = normalized_alpha(rgb, trimap, tolerance=1e-12, most_steps=1)
    assert not found.is_converged
    assert f"residual {found.residual:.1e}" in caplog.text
    assert np.isfinite(alpha).all()


@pytest.mark.parametrize(("value", "what"), [(T, "background"), (B, "tree")])
def test_too_few_scribbles_are_refused(value: float, what: str) -> None:
    trimap = np.full((9, 9), U)
    trimap[4, 4] = value
    with pytest.raises(StageError, match=f"known to be {what}"):
        normalized_alpha(np.zeros((9, 9, 3)), trimap)


def test_a_picture_smaller_than_a_window_is_refused() -> None:
    with pytest.raises(ValueError, match="2 x 9 pixels; a window of 3 x 3 does not fit"):
        matting_laplacian(np.zeros((9, 2, 3)), 1, 1e-4)


def test_halving_keeps_thin_scribbles_and_drops_contradictions() -> None:
    trimap = np.array([[T, U, U, U, B], [U, U, U, U, U], [T, B, U, U, U]])
    assert_array_equal(halved(trimap), [[T, U, B], [U, U, U]])


def segment(scene: scenes.Scene, **settings: object) -> Mattes:
    method = NormalizedMatte(**settings)  # type: ignore[arg-type]
    return method(scene.photo, scene.strokes, rng=np.random.default_rng(0))


@pytest.mark.parametrize("settings", [{}, {"pull": 0.0, "radius": 2}])
def test_the_tree_is_found(settings: dict[str, object]) -> None:
    scene = scenes.leafy()
    mattes = segment(scene, **settings)
    assert scenes.overlap(mattes.is_tree, scene.is_tree) > 0.93
    assert not mattes.is_bare
    below = scene.is_wood & (np.arange(scenes.H)[:, None] > 290)
    assert scenes.overlap(mattes.is_branch[290:], below[290:]) > 0.9
    assert (mattes.foliage + mattes.branch).max() <= 1 + 1e-6


def test_a_bare_tree_has_no_leaf() -> None:
    scene = scenes.bare()
    mattes = segment(scene)
    assert mattes.is_bare
    assert scenes.overlap(mattes.is_branch, scene.is_wood) > 0.85


def test_strokes_that_contradict_each_other_are_refused() -> None:
    scene = scenes.leafy()
    strokes = replace(scene.strokes, background=(scene.strokes.branches[0],))
    with pytest.raises(StageError, match="100% of the 'branches' strokes lie under 'background'"):
        NormalizedMatte()(scene.photo, strokes, rng=np.random.default_rng(0))


def test_a_crown_on_plain_sky_is_refused() -> None:
    scene = scenes.leafy()
    sky = Photo(np.full_like(scene.photo.rgb, 180), "sky.png")
    with pytest.raises(StageError, match="outline on the tree"):
        NormalizedMatte()(sky, scene.strokes, rng=np.random.default_rng(0))


@pytest.mark.parametrize(("name", "value"), [("radius", 0), ("band", 0), ("epsilon", 0.0), ("tolerance", -1.0)])
def test_settings_out_of_range_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} is {value}; expected"):
        NormalizedMatte(**{name: value})  # type: ignore[arg-type]
