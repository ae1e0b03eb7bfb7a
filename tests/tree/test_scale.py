"""The scale of a photo, and which part of a matte is the tree's own."""

from __future__ import annotations

import numpy as np
import pytest

from forestgen.errors import StageError
from forestgen.tree.mattes import Mattes
from forestgen.tree.scale import own_part, photo_camera
from forestgen.tree.strokes import Strokes

SIZE = (200, 300)  # px


def strokes() -> Strokes:
    """A crown of 80 x 100 px over a trunk of 120 px; its foot at (100, 280)."""
    crown = np.array([[60, 60], [140, 60], [140, 160], [60, 160]], float)
    return Strokes(crown, (np.array([[100, 280], [100, 150]], float),), size=SIZE)


def mattes(*boxes: tuple[int, int, int, int], wood: bool = True) -> Mattes:
    """Foliage in boxes (left, top, right, bottom), and the trunk."""
    leaf, branch = np.zeros((2, *SIZE[::-1]), np.float32)
    for left, top, right, bottom in boxes:
        leaf[top:bottom, left:right] = 1
    if wood:
        branch[150:280, 97:103] = 1
        branch = np.minimum(branch, 1 - leaf)
    return Mattes(leaf, branch)


def test_scale_is_from_the_root_to_the_highest_own_row() -> None:
    camera = photo_camera(mattes((70, 80, 130, 160)), strokes(), 10.0)
    assert camera.size == SIZE
    assert camera.root_px == (100.0, 280.0)
    assert camera.px_per_metre == pytest.approx((280 - 80) / 10)


def test_scale_does_not_count_another_tree() -> None:
    taller = mattes((70, 80, 130, 160), (170, 5, 195, 300))  # a neighbour behind, nowhere near the strokes
    assert photo_camera(taller, strokes(), 10.0).px_per_metre == pytest.approx(20)


def test_leaves_a_little_apart_are_the_trees_own() -> None:
    own = mattes((70, 61, 130, 160), (90, 54, 110, 58))  # 3 px above the crown: less than 2 % of 220 px
    assert photo_camera(own, strokes(), 10.0).px_per_metre == pytest.approx((280 - 54) / 10)
    far = mattes((70, 80, 130, 160), (90, 20, 110, 40))
    assert not own_part(far.is_tree, strokes())[20:40].any()


def test_own_part_takes_what_the_strokes_touch() -> None:
    mask = mattes((70, 80, 130, 160), (170, 5, 195, 300)).is_tree
    own = own_part(mask, strokes())
    assert own[80:160, 70:130].all()
    assert own[200, 100]  # the trunk
    assert not own[:, 170:].any()
    assert not (own & ~mask).any()


def test_the_user_may_say_scale_root_and_focal_length() -> None:
    camera = photo_camera(
        mattes((70, 80, 130, 160)), strokes(), 10.0, scale=1.1, root=(90.0, 290.0), azimuth=1.5, focal_px=800.0
    )
    assert camera.px_per_metre == pytest.approx(1.1 * (290 - 80) / 10)
    assert camera.root_px == (90.0, 290.0)
    assert camera.azimuth == 1.5
    assert camera.focal_px == 800.0


def test_a_tree_below_its_root_is_refused() -> None:
    with pytest.raises(StageError, match="draw the trunk from the ground upward"):
        photo_camera(mattes(wood=False), strokes(), 10.0)
    with pytest.raises(StageError, match="above its root"):
        photo_camera(mattes((70, 80, 130, 160)), strokes(), 10.0, root=(100.0, 60.0))
