"""The measures on masks small enough to be checked by eye, and against the independent scorer."""

from __future__ import annotations

import importlib.util

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.check import metrics


def mask(*rows: str) -> np.ndarray:
    return np.array([[cell == "#" for cell in row] for row in rows])


def block(shape, top, bottom, left, right) -> np.ndarray:
    out = np.zeros(shape, bool)
    out[top:bottom, left:right] = True
    return out


def blobs(seed: int, shape=(90, 70), level=0.3) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=shape)
    return cv2.GaussianBlur(noise, (0, 0), 3) > level * 0.1


def test_iou_by_hand():
    assert metrics.iou(mask("##.", "..."), mask(".##", "...")) == pytest.approx(1 / 3)
    assert metrics.iou(mask("..."), mask("...")) == 1
    assert metrics.iou(mask("#.."), mask("...")) == 0


def test_an_envelope_closes_gaps_below_the_disc_and_fills_holes():
    ring = block((140, 140), 20, 120, 20, 120) & ~block((140, 140), 40, 100, 40, 100)
    assert (metrics.envelope(ring, 100.0) == block((140, 140), 20, 120, 20, 120)).all()
    gap = block((140, 140), 20, 120, 20, 68) | block((140, 140), 20, 120, 71, 120)  # 3 px wide, disc of 2 px
    assert metrics.envelope(gap, 100.0)[70, 68:71].all()
    wide = block((140, 140), 20, 120, 20, 60) | block((140, 140), 20, 120, 71, 120)
    assert not metrics.envelope(wide, 100.0)[70, 63:68].any()
    assert not metrics.envelope(np.zeros((20, 20), bool), 100.0).any()


def test_an_envelope_does_not_shrink_at_the_frame():
    cut = block((60, 60), 0, 60, 0, 60)
    assert metrics.envelope(cut, 200.0).all()


def test_an_outline_is_one_pixel_wide_and_not_on_the_frame():
    square = block((7, 7), 2, 7, 2, 5)
    assert (metrics.outline(square) == square & ~block((7, 7), 3, 7, 3, 4)).all()


def test_boundary_f_by_hand():
    a = block((300, 300), 50, 250, 50, 250)
    assert metrics.boundary_f(a, a, 200.0) == 1
    near = np.roll(a, 2, axis=1)  # within 1 % of 200 px
    assert metrics.boundary_f(a, near, 200.0) == 1
    far = np.roll(a, 5, axis=1)  # the two upright sides are 5 px off, the level ones still lie over each other
    assert metrics.boundary_f(a, far, 200.0) == pytest.approx(0.5, abs=0.03)
    assert metrics.boundary_f(a, np.zeros_like(a), 200.0) == 0
    assert metrics.boundary_f(np.zeros_like(a), np.zeros_like(a), 200.0) == 1


@pytest.mark.parametrize("width", [63, 64, 65, 130])
def test_best_shifted_iou_equals_trying_every_shift(width):
    a, b = blobs(1, (40, width)), blobs(2, (40, width))

    def shifted(dx, dy):
        out = np.zeros_like(b)
        h, w = b.shape
        out[max(0, dy) : h - max(0, -dy), max(0, dx) : w - max(0, -dx)] = b[
            max(0, -dy) : h - max(0, dy), max(0, -dx) : w - max(0, dx)
        ]
        return out

    plain = max(metrics.iou(a, shifted(dx, dy)) for dx in range(-3, 4) for dy in range(-3, 4))
    assert metrics.best_shifted_iou(a, b, 3) == pytest.approx(plain, abs=1e-12)
    assert metrics.best_shifted_iou(a, b, 0) == pytest.approx(metrics.iou(a, b), abs=1e-12)


def test_a_shift_within_reach_costs_nothing():
    a = block((50, 50), 10, 30, 10, 30)
    assert metrics.best_shifted_iou(a, np.roll(a, (2, -3), (0, 1)), 3) == 1
    assert metrics.best_shifted_iou(a, np.roll(a, (2, -4), (0, 1)), 3) < 1


def test_skill_is_nought_for_leaves_thrown_at_random_and_one_for_the_same_picture():
    rng = np.random.default_rng(3)
    inside = block((420, 420), 10, 410, 10, 410)
    leaves, thrown = (inside & (rng.random(inside.shape) < 0.6) for _ in range(2))
    assert metrics.skill(leaves, thrown, inside, 50.0) == pytest.approx(0, abs=0.02)
    assert metrics.skill(leaves, leaves, inside, 50.0) == 1
    assert metrics.skill(inside, inside, inside, 50.0) == 1  # nothing to be skilled in


def test_gap_recall_by_hand():
    solid = block((100, 100), 0, 100, 0, 100)
    reference = solid & ~block((100, 100), 10, 30, 10, 30) & ~block((100, 100), 60, 65, 60, 65)
    render = solid & ~block((100, 100), 20, 30, 10, 30)  # half of the large hole; the small one is below 1 %
    assert metrics.gap_recall(reference, render, solid) == pytest.approx(0.5)
    assert metrics.gap_recall(solid, render, solid) == 1


def test_holes_that_touch_by_corners_are_two():
    solid = block((100, 100), 0, 100, 0, 100)
    corners = block((100, 100), 10, 20, 10, 20) | block((100, 100), 20, 30, 20, 30)  # 1 % each: not above it
    assert metrics.gap_recall(solid & ~corners, solid, solid) == 1


def test_grid_coverage_shares_pixels_between_cells():
    full = np.ones((10, 10), bool)
    assert_allclose(metrics.grid_coverage(full, (0.0, 0.0, 10.0, 10.0)), 1)
    half = block((48, 48), 0, 48, 0, 24)
    coverage = metrics.grid_coverage(half, (0.0, 0.0, 48.0, 48.0))
    assert_allclose(coverage[:, :12], 1)
    assert_allclose(coverage[:, 12:], 0)
    offset = metrics.grid_coverage(half, (12.5, 0.0, 36.5, 24.0))
    assert_allclose(offset[:, 11], 0.5)  # the cell from 23.5 to 24.5 is half covered


def test_density_correlation_by_hand():
    left, box = block((48, 48), 0, 48, 0, 24), (0.0, 0.0, 48.0, 48.0)
    assert metrics.density_correlation(left, left, box) == pytest.approx(1)
    assert metrics.density_correlation(left, ~left, box) == pytest.approx(-1)
    full = np.ones_like(left)
    assert metrics.density_correlation(full, full, box) == 1
    assert metrics.density_correlation(full, left, box) == 0


def test_colour_difference_is_that_of_the_means_over_the_masks():
    from skimage.color import deltaE_ciede2000, rgb2lab

    tree = block((120, 120), 20, 100, 20, 100)
    a, b = np.array([0.2, 0.5, 0.1]), np.array([0.3, 0.45, 0.2])
    sky = np.array([0.6, 0.7, 1.0])
    photo = np.where(tree[..., None], a, sky).astype(np.float32)
    render = np.where(tree[..., None], b, 0).astype(np.float32)
    expected = deltaE_ciede2000(rgb2lab(a), rgb2lab(b))
    found = metrics.colour_delta_e(photo, tree, render, tree, tree, 80.0)
    assert found == pytest.approx(float(expected), rel=1e-3)
    assert metrics.colour_delta_e(photo, tree, photo, tree, tree, 80.0) == pytest.approx(0, abs=1e-4)


def test_colour_is_compared_only_where_both_are():
    tree = block((200, 200), 20, 180, 20, 180)
    gone = block((200, 200), 20, 180, 20, 60)  # the render lacks the right part, whose colour is off
    photo = np.zeros((200, 200, 3), np.float32) + 0.3
    photo[:, 120:] = [0.9, 0.1, 0.1]
    render = np.zeros((200, 200, 3), np.float32) + 0.3
    assert metrics.colour_delta_e(photo, tree, render, gone, tree, 100.0) < 0.1
    assert metrics.colour_delta_e(photo, tree, render, np.zeros_like(tree), tree, 100.0) == 100


@pytest.mark.parametrize("height_px", [150.0, 420.0, 900.0])
def test_colour_by_cells_equals_colour_by_pixels(height_px):
    from skimage.color import deltaE_ciede2000, rgb2lab

    rng = np.random.default_rng(8)
    size = (int(height_px * 1.2), int(height_px * 0.9))
    reference, render = (cv2.resize(blobs(k).astype(np.uint8), size[::-1]) > 0 for k in (1, 2))
    coarse = rng.random((2, 12, 10, 3)).astype(np.float32)
    photo, colour = (np.clip(cv2.resize(c, size[::-1], interpolation=cv2.INTER_CUBIC), 0, 1) for c in coarse)
    outer = metrics.envelope(reference, height_px)
    sigma = 0.02 * height_px

    def blur(picture, mask):
        share = cv2.GaussianBlur(mask.astype(float), (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
        mixed = cv2.GaussianBlur(picture * mask[..., None].astype(float), (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
        return mixed / np.maximum(share, 1e-9)[..., None], share

    (a, in_a), (b, in_b) = blur(photo, reference), blur(colour, render)
    where = outer & (in_a > 0.1) & (in_b > 0.1)
    plain = deltaE_ciede2000(rgb2lab(np.clip(a[where], 0, 1)), rgb2lab(np.clip(b[where], 0, 1))).mean()
    found = metrics.colour_delta_e(photo, reference, colour, render, outer, height_px)
    assert found == pytest.approx(plain, rel=0.003)
    assert plain > 5


def test_points_along_edges_are_about_a_pixel_apart():
    points = metrics.points_along(np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 5.0]]), np.array([-1, 0, 1]))
    assert len(points) == 15
    assert_allclose(points[:10, 1], 0)
    assert_allclose(points[10:, 0], 10)
    assert points[:10, 0].mean() == pytest.approx(5)
    assert len(metrics.points_along(np.zeros((1, 2)), np.array([-1]))) == 0


NONE = np.zeros((100, 60), bool)
TRUNK = metrics.points_along(np.array([[30.5, 90.0], [30.5, 10.0]]), np.array([-1, 0]))


def test_branch_chamfer_is_nought_on_the_middle_line_whatever_the_width():
    wood = block((100, 60), 10, 90, 27, 34)
    assert metrics.branch_chamfer(TRUNK, NONE, wood, NONE, 80.0) < 0.02


def test_branch_chamfer_measures_a_shift_both_ways():
    wood = block((100, 60), 10, 90, 38, 39)  # 8 px to the right
    assert metrics.branch_chamfer(TRUNK, NONE, wood, NONE, 80.0) == pytest.approx(0.1, rel=0.02)


def test_branches_hidden_by_leaves_do_not_count():
    crown = block((100, 60), 0, 50, 0, 60)
    stem = block((100, 60), 50, 90, 30, 31)
    # the render hides the upper half of the traced trunk
    assert metrics.branch_chamfer(TRUNK, NONE, stem, crown, 80.0) < 0.01
    # the same render without leaves lacks half of the trunk
    assert metrics.branch_chamfer(TRUNK, NONE, stem, NONE, 80.0) > 0.05
    # wood that the render shows where the photo has foliage is not to be found there
    stray = stem | block((100, 60), 20, 21, 0, 30)
    assert metrics.branch_chamfer(TRUNK[:40], crown, stray, crown, 80.0) < 0.01
    assert metrics.branch_chamfer(TRUNK[:40], NONE, stray, crown, 80.0) > 0.05


def test_branch_chamfer_with_nothing_on_one_side():
    everywhere = np.ones((100, 60), bool)
    assert metrics.branch_chamfer(TRUNK, everywhere, NONE, everywhere, 80.0) == 0  # nothing to disagree about
    assert metrics.branch_chamfer(TRUNK, NONE, NONE, NONE, 80.0) == 1  # a trunk that is not there
    outside = TRUNK + np.array([500.0, 0.0])
    assert metrics.branch_chamfer(outside, NONE, NONE, NONE, 80.0) == 0


@pytest.mark.parametrize("tree", ["oak_summer", "ash_open", "oak_winter", "pine_medium"])
def test_figures_agree_with_the_independent_scorer(shared, tree):
    spec = importlib.util.spec_from_file_location("score_tree", shared / "tools" / "score_tree.py")
    scorer = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(scorer)
    views = [cv2.imread(str(shared / "ground_truth" / tree / f"ortho_az{a}_mask.png")) for a in ("000", "180")]
    reference, render = (scorer.cover_of(view) for view in views)
    render = np.roll(render[:, ::-1], 1, axis=1)  # the back, mirrored, is nearly the front
    height_px = float(np.ptp(np.flatnonzero(reference.any(axis=1))))
    theirs, _ = scorer.compare(views[0], render, render, height_px, False)
    outer, drawn = metrics.envelope(reference, height_px), metrics.envelope(render, height_px)
    assert metrics.iou(outer, drawn) == pytest.approx(theirs["envelope_iou"], abs=1e-9)
    assert metrics.iou(reference, render) == pytest.approx(theirs["silhouette_iou"], abs=1e-9)
    assert metrics.skill(reference, render, outer, height_px) == pytest.approx(theirs["skill"], abs=1e-6)
    # their distances are approximate, ours exact
    assert metrics.boundary_f(outer, drawn, height_px) == pytest.approx(theirs["boundary_f"], abs=0.01)
