"""The raster draws what OpenGL draws: the same samples, the same colours; in several colours at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.camera import Camera
from forestgen.render import raster_kernels
from forestgen.render.drawable import Drawable
from forestgen.render.model_drawables import level_drawables
from forestgen.render.raster import pictures
from forestgen.render.studio import Studio
from forestgen.tree.level import full_level
from forestgen.tree.model import TreeModel
from tests.render.small_trees import forked_tree

CAMERA = Camera((8, 6), (0.0, 6.0), 1.0)  # a metre a pixel, the origin in the lower left corner
WHITE = np.full((4, 4, 4), 255, np.uint8)


def quad(x0: float, x1: float, y0: float, y1: float, z: float = 0.0, texture: np.ndarray = WHITE, **more) -> Drawable:
    """An upright rectangle in metres."""
    points = np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]])
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    return Drawable(name="q", points=points, faces=[[0, 1, 2], [0, 2, 3]], uv=uv, texture=texture, **more)


def plain(rgb: tuple[int, int, int]) -> np.ndarray:
    texture = WHITE.copy()
    texture[..., :3] = rgb
    return texture


def leafy_tree() -> TreeModel:
    """A tree whose leaves are round and patterned."""
    model = forked_tree(400)
    row, column = np.indices((64, 64)) - 31.5
    rgba = np.random.default_rng(4).integers(0, 110, (64, 64, 4)).astype(np.uint8)
    rgba[..., 3] = np.clip(255 * (28 - np.hypot(row, column)) / 4, 0, 255)
    bark = np.random.default_rng(5).integers(0, 255, (32, 64, 3)).astype(np.uint8)
    return replace(model, atlas=replace(model.atlas, rgba=rgba), bark=replace(model.bark, rgb=bark))


def of_tree(model: TreeModel) -> list[Drawable]:
    return level_drawables(full_level(model), model.bark, model.atlas.rgba)


def test_a_rectangle_covers_its_pixels_from_edge_to_edge():
    share = pictures([quad(2, 5, 1, 3)], CAMERA, [None])[0]
    expected = np.zeros((6, 8, 4))
    expected[3:5, 2:5] = 1
    assert_allclose(share, expected, atol=1e-6)


def test_edges_have_four_steps_both_ways():
    for k in range(5):
        assert pictures([quad(2, 4 + k / 4, 1, 3)], CAMERA, [None])[0][4, 4, 3] == k / 4
        assert pictures([quad(2, 4, 1, 3 + k / 4)], CAMERA, [None])[0][2, 2, 3] == k / 4


def test_what_is_nearer_wins_and_of_equally_near_ones_the_first():
    red, blue = quad(1, 4, 1, 4, 0.0, plain((255, 0, 0))), quad(1, 4, 1, 4, 1.0, plain((0, 0, 255)))
    behind = Camera((8, 6), (8.0, 6.0), 1.0, np.pi)
    for order in ([red, blue], [blue, red]):
        assert_allclose(pictures(order, CAMERA, [None])[0][3, 2], [0, 0, 1, 1], atol=1e-6)
        assert_allclose(pictures(order, behind, [None])[0][3, 5], [1, 0, 0, 1], atol=1e-6)
    same = replace(blue, points=red.points)
    assert_allclose(pictures([same, red], CAMERA, [None])[0][3, 2], [0, 0, 1, 1], atol=1e-6)


def test_a_texture_lies_upright_repeats_and_is_cut_out_where_alpha_is_low():
    texture = plain((0, 255, 0))
    texture[:2, :, :3] = [255, 0, 0]  # the upper half
    texture[:, :2, 3] = 0  # the left half is clear
    picture = pictures([quad(0, 4, 0, 4, texture=texture)], CAMERA, [None])[0]
    assert_allclose(picture[3, 3], [1, 0, 0, 1], atol=1e-5)
    assert_allclose(picture[4, 3], [0, 1, 0, 1], atol=1e-5)
    assert not picture[2:, :2].any()
    twice = quad(0, 8, 0, 4, texture=texture)
    twice = replace(twice, uv=twice.uv * [2, 1] - [3, 5])
    again = pictures([twice], CAMERA, [None])[0]
    assert_array_equal(again[..., 3], np.hstack([picture[:, :4, 3]] * 2))
    assert_allclose(again[[3, 5, 3, 5], [3, 3, 7, 7]], picture[[3, 5, 3, 5], 3], atol=1e-5)


def test_a_texture_finer_than_pixels_is_seen_as_its_mean():
    rgb = np.random.default_rng(2).integers(0, 255, (64, 64, 3))
    texture = np.dstack([rgb, np.full((64, 64), 255)]).astype(np.uint8)
    picture = pictures([quad(0, 4, 0, 4, texture=texture)], CAMERA, [None])[0]
    blocks = rgb.reshape(4, 16, 4, 16, 3).mean(axis=(1, 3)) / 255
    assert_allclose(picture[2:6, :4, :3], blocks, atol=0.02)


def test_each_atlas_gives_what_it_gives_alone():
    model = leafy_tree()
    other = model.atlas.rgba.copy()
    other[..., :3] = 255 - other[..., :3]
    camera = Camera((90, 80), (40.0, 78.0), 18.0, 0.3)
    worn = [model.atlas.rgba, None, other]
    together = pictures(of_tree(model), camera, worn)
    for atlas, picture in zip(worn, together, strict=True):
        assert_array_equal(pictures(of_tree(model), camera, [atlas])[0], picture)
    wood = [drawable for drawable in of_tree(model) if not drawable.is_leaf]
    assert_array_equal(pictures(wood, camera, [other])[0], together[1])
    assert_array_equal(together[0][..., 3], together[2][..., 3])
    assert together[0][..., 3].sum() > 1.5 * together[1][..., 3].sum()
    assert np.abs(together[0] - together[2]).max() > 0.3


def test_the_compiled_loops_give_what_plain_ones_give(monkeypatch):
    model = leafy_tree()
    camera = Camera((40, 36), (18.0, 35.0), 8.0, 0.7, 0.3)
    fast = pictures(of_tree(model), camera, [model.atlas.rgba, None])
    for name in ("texels_about", "interpolated", "_add"):
        monkeypatch.setattr(raster_kernels, name, getattr(raster_kernels, name).py_func)
    for name in ("seen", "cover", "shade"):
        monkeypatch.setattr(f"forestgen.render.raster.{name}", getattr(raster_kernels, name).py_func)
    for one, other in zip(fast, pictures(of_tree(model), camera, [model.atlas.rgba, None]), strict=True):
        assert_allclose(one, other, atol=1e-5)


@pytest.mark.gl
@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 0.0), (2.1, 0.0), (0.4, 0.6), (0.0, np.pi / 2)])
def test_opengl_draws_the_same(azimuth, elevation):
    model = leafy_tree()
    camera = Camera((330, 300), (150.3, 230.6), 60.0, azimuth, elevation)
    own = pictures(of_tree(model), camera, [model.atlas.rgba])[0]
    with Studio(of_tree(model)) as studio:
        theirs = studio.colour(camera)
    assert (np.abs(own[..., 3] - theirs[..., 3]) > 0.01).mean() < 0.002
    both = (own[..., 3] == 1) & (theirs[..., 3] == 1)
    assert both.mean() > 0.02
    assert np.abs(own - theirs)[both].mean() < 0.012
    assert np.abs((own - theirs)[both].mean(axis=0)).max() < 0.008, "OpenGL rounds levels and samples up"


def test_a_perspective_camera_is_refused():
    with pytest.raises(ValueError, match="orthographic"):
        pictures([quad(0, 1, 0, 1)], replace(CAMERA, focal_px=90.0), [None])


def test_a_drawable_without_a_texture_is_refused():
    with pytest.raises(ValueError, match="'q' has no texture"):
        pictures([replace(quad(0, 1, 0, 1), texture=None)], CAMERA, [None])


def test_nothing_to_draw_is_an_empty_picture():
    assert [not picture.any() for picture in pictures([], CAMERA, [None, WHITE])] == [True, True]
