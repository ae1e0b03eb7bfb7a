"""Wood that a photo would show against the sky, and does not, is thin; other wood is as it was."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.camera import Camera
from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.radius import MeasuredTaper
from forestgen.tree.radius_unseen import UNSEEN_PX, unseen_radius
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strokes import Strokes
from forestgen.tree.view import View

PX = 10.0  # px a metre


def drawn_view() -> View:
    """A trunk up the middle of 100 x 100 px, foliage above row 40, sky elsewhere."""
    foliage = np.zeros((100, 100), np.float32)
    foliage[:40] = 1
    wood = np.zeros((100, 100), np.float32)
    wood[40:, 49:51] = 1
    trunk = np.array([[50.0, 100.0], [50.0, 30.0]])
    crown = np.array([[0.0, 0.0], [100.0, 0.0], [50.0, 60.0]])
    graph = BranchGraph(trunk, np.array([-1, 0]), np.array([3.0, 3.0]))
    photo = Photo(np.zeros((100, 100, 3), np.uint8), "drawn.png")
    return View(
        photo, Strokes(crown, (trunk,)), Mattes(foliage, wood), graph, Camera((100, 100), (50.0, 100.0), PX, 0.0)
    )


#   4 ---- 5       row 20, in the foliage
#   |
#   1 -- 2 -- 3    row 70, before the sky
#   0
PARENT = np.array([-1, 0, 1, 2, 1, 4])
XY = np.array([[50, 100], [50, 70], [70, 70], [90, 70], [50, 20], [90, 20]], float)


def skeleton_of(view: View) -> Skeleton:
    radius = np.array([0.5, 0.4, np.nan, np.nan, 0.3, np.nan])
    return Skeleton(view.camera.unproject(XY, 0.0), PARENT, radius)


def test_only_what_lies_before_the_sky_is_bounded() -> None:
    view = drawn_view()
    slim = np.full(6, 0.1)  # a pixel to either side
    most = unseen_radius(skeleton_of(view), [view], slim)
    assert_allclose(most[[2, 3]], UNSEEN_PX / PX)
    assert np.isinf(most[[0, 1, 4, 5]]).all()  # the trunk's matte is narrower than its trace: no sky there
    assert np.isinf(unseen_radius(skeleton_of(view), [], slim)).all()


def test_wood_at_the_rim_of_the_foliage_must_not_stand_out_over_the_sky() -> None:
    view = drawn_view()
    along_the_rim = np.array([[50, 100], [60, 39], [90, 39]], float)  # foliage ends at row 40
    skeleton = Skeleton(view.camera.unproject(along_the_rim, 0.0), np.array([-1, 0, 1]), np.full(3, np.nan))
    radius = np.array([0.1, 0.1, 0.1])
    assert np.isinf(unseen_radius(skeleton, [view], 0.5 * radius)[2])  # half a pixel: it stays over the leaves
    assert_allclose(unseen_radius(skeleton, [view], 2 * radius)[2], UNSEEN_PX / PX)


def test_thin_wood_before_the_sky_is_too_thin_to_show_and_thick_wood_stays() -> None:
    view = drawn_view()
    skeleton = skeleton_of(view)
    usual = MeasuredTaper(slender=0.0)(skeleton, [view]).radius
    all_thin = MeasuredTaper(slender=1.0)(skeleton, [view]).radius
    assert_allclose(all_thin[[2, 3]], UNSEEN_PX / PX)
    assert_array_equal(all_thin[[0, 1, 4, 5]], usual[[0, 1, 4, 5]])
    assert_array_equal(MeasuredTaper(slender=1e-6)(skeleton, [view]).radius, usual)
