"""Density from views: solids of known shape come back, and views that disagree are refused."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from forestgen.camera import Camera
from forestgen.check.metrics import envelope, iou
from forestgen.errors import StageError
from forestgen.tree.density import DensityVolume
from forestgen.tree.density_views import (
    density_residual,
    density_steps,
    estimate_density,
    mean_seen,
    seen_and_drawn,
    view_density,
)
from tests.tree.solids import (
    PX,
    SIZE,
    ball,
    box,
    camera,
    drawn,
    shadow,
    true_views,
    trunk,
    view_of,
    views_of,
    volume_iou,
)

CROWN = ball((0.0, 6.5, 0.0), 2.5)


def test_a_ball_comes_back_from_two_views_without_the_hulls_corners() -> None:
    views = views_of(CROWN, trunk(5))
    round_ = estimate_density(views, resolution=48)
    assert volume_iou(round_, CROWN, trunk(5)) > 0.85
    hull = estimate_density(views, resolution=48, prior=False, refine=False)
    oblique = camera(45)
    truth = shadow(CROWN, oblique) | shadow(trunk(5), oblique)
    assert iou(truth, drawn(round_, oblique)) > 0.9 > 0.8 > iou(truth, drawn(hull, oblique))


@pytest.mark.parametrize(
    "cameras",
    [
        (camera(0), camera(60), camera(120)),
        (camera(30), camera(120)),
        (camera(0, focal_px=300), camera(90, focal_px=300)),
        (camera(0, 15), camera(90, 15)),
        (camera(0),),
    ],
    ids=["three", "turned", "perspective", "from above", "one"],
)
def test_a_ball_comes_back_from_other_cameras(cameras: tuple[Camera, ...]) -> None:
    volume = estimate_density(views_of(CROWN, trunk(5), cameras=cameras), resolution=48)
    assert volume_iou(volume, CROWN, trunk(5)) > 0.75
    low, high = (volume.centres(volume.is_filled)[:, [0, 2]].min(axis=0), volume.centres(volume.is_filled).max(axis=0))
    assert np.abs(low + 2.5).max() < 0.45  # as deep as wide
    assert np.abs(high[[0, 2]] - 2.5).max() < 0.45


def test_balls_at_their_own_heights_are_told_apart() -> None:
    left, right = ball((-2.2, 3.0, -2.0), 1.5), ball((2.0, 7.5, 2.0), 1.7)
    volume = estimate_density(views_of(left, right), resolution=48)
    assert volume_iou(volume, left, right) > 0.75


def test_both_outlines_stay_whole() -> None:
    solids = box((-3, 3, -1), (1, 6, 3.5)), box((-1, 6, -3), (3, 9, 1)), trunk(4)
    views = views_of(*solids)
    volume = estimate_density(views, resolution=64)
    for view in views:
        seen = view_density(view) >= 0.5
        inner = cv2.erode(seen.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        assert not (inner & ~drawn(volume, view.camera)).any()
        assert iou(seen, drawn(volume, view.camera)) > 0.92


def test_a_trunk_thinner_than_a_voxel_is_kept_from_ground_to_crown() -> None:
    stem = np.zeros(SIZE[::-1])
    stem[90:150, 80] = 1.0  # 0.1 m wide, a third of a voxel
    views = [view_of(np.maximum(v.mattes.foliage, stem), v.camera) for v in views_of(CROWN)]
    volume = estimate_density(views, resolution=25)
    assert volume.edge > 0.3
    assert volume.is_filled.any(axis=(0, 2)).all()


def test_a_gap_in_one_view_is_empty_through_the_whole_depth() -> None:
    window = box((-1, 5.5, -9), (1, 7.5, 9))
    view, side = views_of(CROWN, trunk(5))
    pierced = np.where(shadow(window, view.camera), 0.0, view.mattes.foliage)
    volume = estimate_density([view_of(pierced, view.camera), side], resolution=48)
    inner = box((-0.8, 5.7, -9), (0.8, 7.3, 9))(volume.centres(volume.is_filled))
    assert not inner.any()


def test_a_lobe_that_sticks_out_is_no_sheet() -> None:
    lobe = ball((3.0, 6.5, 0.0), 0.9)
    volume = estimate_density(views_of(CROWN, lobe, trunk(5)), resolution=64)
    outer = volume.centres(volume.is_filled)
    outer = outer[(outer[:, 0] > 2.8) & (outer[:, 0] < 3.4) & (np.abs(outer[:, 1] - 6.5) < 0.2)]
    assert np.ptp(outer[:, 2]) > 0.6
    assert np.abs(outer[:, 2].mean()) < 0.2


def test_views_that_disagree_a_little_lose_no_row() -> None:
    front, _ = views_of(CROWN, trunk(5))
    lower = views_of(ball((0.0, 6.35, 0.0), 2.5), trunk(5))[1]  # its top is 0.15 m lower
    volume = estimate_density([front, lower], resolution=64)
    top = np.flatnonzero(drawn(volume, front.camera).any(axis=1))[0]
    assert top <= np.flatnonzero(front.mattes.is_foliage.any(axis=1))[0] + 1


@pytest.mark.parametrize("prior", [True, False])
def test_contradictory_silhouettes_are_refused_by_name(prior: bool) -> None:
    high, _ = views_of(ball((0.0, 8.0, 0.0), 1.5))
    _, low = views_of(ball((0.0, 2.0, 0.0), 1.5))
    with pytest.raises(StageError, match=r"view_0.png: 100% .* no place that is tree in view_1.png .*check .* azimuth"):
        estimate_density([high, low], resolution=25, prior=prior)


def test_a_view_without_a_tree_is_refused_by_name() -> None:
    front, _ = views_of(CROWN)
    with pytest.raises(StageError, match=r"empty.png: this view shows nothing of the tree"):
        estimate_density([front, view_of(np.zeros(SIZE[::-1]), camera(90), "empty.png")])


def test_refinement_explains_the_photos_better_than_the_first_guess() -> None:
    views = views_of(CROWN, trunk(5))
    thin = [view_of(np.where(np.arange(SIZE[0]) < SIZE[0] // 2, 0.6, 1) * v.mattes.foliage, v.camera) for v in views]
    for prior, least in ((True, 0.1), (False, 0.25)):
        first = density_residual(estimate_density(thin, resolution=32, refine=False, prior=prior), thin)
        refined = density_residual(estimate_density(thin, resolution=32, prior=prior), thin)
        assert (refined < 0.75 * first).all()
        assert (refined < least).all()


def test_what_looks_thin_becomes_thin() -> None:
    view, side = views_of(CROWN)
    thin = view_of(np.where(np.arange(SIZE[0]) < SIZE[0] // 2, 0.6, 0.95) * view.mattes.foliage, view.camera)
    volume = estimate_density([thin, side], resolution=32)
    x = volume.centres()[:, 0].reshape(volume.alpha.shape)
    assert volume.alpha[volume.is_filled & (x < -0.3)].mean() < 0.7 * volume.alpha[volume.is_filled & (x > 0.3)].mean()


def test_the_drawn_squares_of_a_volume_are_where_its_photo_shows_them() -> None:
    views = views_of(CROWN, trunk(5))
    seen, shown = seen_and_drawn(estimate_density(views, resolution=32), views[1])
    assert np.corrcoef(seen.ravel(), shown.ravel())[0, 1] > 0.95


def test_the_first_guess_is_the_least_mean_density_of_the_voxels_images() -> None:
    grid = DensityVolume(np.zeros((1, 1, 1)), np.array([-0.5, 2.0, -0.5]), 1.0)
    image = np.zeros(SIZE[::-1])
    image[:, 80:] = 1.0
    front = view_of(image, camera())
    assert mean_seen(image, front, grid)[0] == pytest.approx(0.5)
    near = view_of(image, camera(focal_px=50.0))  # 5 m away
    assert mean_seen(image, near, grid, np.array([[0.2, 2.5, 0.0]]))[0] == pytest.approx(0.7)
    assert mean_seen(image, near, grid, np.array([[0.2, 4.0, 2.5]]))[0] == pytest.approx(0.7)  # twice as large
    oblique = view_of(image, camera(45))
    half = 0.5 * PX * np.sqrt(2)  # a cube from its edge is wider by the root of 2
    share = mean_seen(image, oblique, grid, np.array([[0.3, 2.5, 0.0]]))[0]
    assert share == pytest.approx((half + 0.3 * PX / np.sqrt(2)) / (2 * half), abs=0.05)


def test_same_views_same_bytes() -> None:
    views = views_of(CROWN, trunk(5))
    first, second = (estimate_density(views, resolution=32).alpha.tobytes() for _ in range(2))
    assert first == second


def test_a_bare_crown_is_filled_between_its_twigs() -> None:
    views = views_of(CROWN, trunk(5))
    comb = np.arange(SIZE[0]) % 3 == 0
    bare = [view_of(np.where(comb, v.mattes.foliage, 0), v.camera) for v in views]
    volume = estimate_density(bare, resolution=48)
    assert volume_iou(volume, CROWN) > 0.7
    assert volume.alpha[volume.is_filled].mean() < 0.1


def test_a_true_tree_keeps_both_outlines_and_is_less_than_its_hull_from_between(shared: Path) -> None:
    folder = shared / "ground_truth" / "maple_autumn"
    views = true_views(folder)
    volume = estimate_density(views)
    assert (density_residual(volume, views) < 0.15).all()
    height_px = volume.edge * volume.alpha.shape[1] * views[0].camera.px_per_metre
    for view in views:
        assert iou(envelope(view.mattes.is_tree, height_px), envelope(drawn(volume, view.camera), height_px)) > 0.97
    frame = json.loads((folder / "truth.json").read_text())["ortho"]
    found = []
    for azimuth in (45, 135):
        true = cv2.imread(str(folder / f"ortho_az{azimuth:03d}_mask.png")).sum(axis=2) >= 128
        oblique = Camera(
            (true.shape[1], true.shape[0]), tuple(frame["root_px"]), frame["px_per_metre"], np.deg2rad(azimuth)
        )
        height_px = volume.edge * volume.alpha.shape[1] * frame["px_per_metre"]
        found.append(iou(envelope(true, height_px), envelope(drawn(volume, oblique), height_px)))
    assert np.mean(found) > 0.779  # a stack of ellipses through both outlines: score_tree's null


def test_steps_for_a_figure_hold_both_volumes_and_what_they_look_like() -> None:
    views = views_of(CROWN, trunk(5))
    first, refined, pictures = density_steps(views)
    assert max(first.alpha.shape) == max(refined.alpha.shape) == 25
    assert (refined.alpha[~first.is_filled] == 0).all()
    assert first.alpha.sum() > refined.alpha.sum()  # each voxel alone explains what its whole ray shows
    assert [seen.shape for seen, _ in pictures] == [shown.shape for _, shown in pictures]
