"""The renderer against shapes whose picture is known exactly."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.camera import Camera
from forestgen.errors import RenderError
from forestgen.render import Drawable, Studio, frame_camera
from forestgen.render.drawable import extent_along
from forestgen.render.projection import camera_pose, projection
from forestgen.render.sunlight import FAR, NEAR, clip_depth, sun_camera
from forestgen.tree.model import vertex_normals

pytestmark = pytest.mark.gl
CAMERA = Camera(size=(200, 120), root_px=(30.0, 100.0), px_per_metre=10.0)
QUARTER = np.pi / 2


def quad(x0, x1, y0, y1, z=0.0, **more) -> Drawable:
    points = np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]], float)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    return Drawable(name="quad", points=points, faces=np.array([[0, 1, 2], [0, 2, 3]]), uv=uv, **more)


def picture_of(drawables, camera=CAMERA):
    with Studio(drawables) as studio:
        return studio.colour(camera)


def place(x=0.0, y=0.0, z=0.0, scale=1.0):
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = x, y, z
    return matrix


def test_a_rectangle_covers_its_very_pixels_and_keeps_its_colour():
    picture = picture_of([quad(1, 6, 2, 5, colour=[0.2, 0.4, 0.6, 1.0])])
    expected = np.zeros((120, 200), bool)
    expected[50:80, 40:90] = True  # root row 100 - 10 px a metre
    assert (picture[..., 3] == expected).all()
    assert_allclose(picture[60, 60], [0.2, 0.4, 0.6, 1.0], atol=1e-6)


def test_edges_inside_a_pixel_cover_their_share():
    share = picture_of([quad(1.05, 6.05, 2, 5)])[..., 3]  # both sides half a pixel further right
    assert_allclose(share[60, [39, 40, 41, 89, 90, 91]], [0, 0.5, 1, 1, 0.5, 0], atol=0.003)


@pytest.mark.parametrize(
    ("root", "azimuth"),
    [((30.0, 100.0), 0.0), ((-40.0, 20.0), 0.7), ((333.3, 260.7), 2.5)],
    ids=["inside", "left of the frame", "right below the frame"],
)
@pytest.mark.parametrize("focal_px", [None, 400.0], ids=["orthographic", "perspective"])
def test_shapes_fall_where_the_camera_projects_them(root, focal_px, azimuth):
    """The centre of gravity of a small far-off square is its projected centre to 0.1 px."""
    camera = Camera((260, 150), root, 20.0, azimuth, 0.2, focal_px)
    for px in ([60.0, 40.0], [201.3, 117.6]):
        centre = camera.unproject([px], 1.5)[0]
        corners = centre + np.array([[-0.6, -0.6], [0.6, -0.6], [0.6, 0.6], [-0.6, 0.6]]) @ camera.axes[:2]
        square = Drawable(name="square", points=corners, faces=np.array([[0, 1, 2], [0, 2, 3]]))
        behind = Drawable(name="far", points=corners - 9 * camera.axes[2], faces=np.array([[0, 1, 2]]), colour=[0] * 4)
        share = picture_of([square, behind], camera)[..., 3]  # what is behind is clear, but spreads the depth range
        rows, columns = np.mgrid[: camera.size[1], : camera.size[0]] + 0.5
        found = np.array([(share * columns).sum(), (share * rows).sum()]) / share.sum()
        assert_allclose(found, camera.project([centre])[0], atol=0.1)
        outline = camera.project(corners)
        side = np.roll(outline, -1, axis=0)
        area = 0.5 * abs(np.sum(outline[:, 0] * side[:, 1] - outline[:, 1] * side[:, 0]))
        assert share.sum() == pytest.approx(area, rel=0.03)


def test_a_triangle_covers_half_of_its_box():
    triangle = Drawable(name="t", points=[[0, 0, 0], [8, 0, 0], [0, 8, 0]], faces=[[0, 1, 2]])
    assert picture_of([triangle])[..., 3].sum() == pytest.approx(80 * 80 / 2, rel=0.003)


def test_cut_outs_leave_holes_that_show_what_is_behind():
    """A texture whose left half is clear: half the coverage, and no depth where it is clear."""
    texture = np.zeros((64, 64, 4), np.uint8)
    texture[:, 32:] = [10, 200, 30, 255]
    front = quad(2, 8, 2, 8, z=1.0, texture=texture, is_leaf=True)
    alone = picture_of([front])[..., 3]
    assert alone.sum() == pytest.approx(60 * 30, rel=0.02)
    both = picture_of([front, quad(0, 10, 0, 10, colour=[1, 0, 0, 1])])
    assert_allclose(both[50, 60, :3], [1, 0, 0], atol=0.01)
    assert_allclose(both[50, 100, :3], [10 / 255, 200 / 255, 30 / 255], atol=0.01)


def test_small_cut_outs_keep_their_true_coverage():
    """Leaves of 3 px with a disc on a large texture: mip levels must not thicken or thin them."""
    rows, columns = np.mgrid[:256, :256]
    disc = np.hypot(rows - 127.5, columns - 127.5) < 80
    texture = np.dstack([np.full((256, 256, 3), 128), disc * 255]).astype(np.uint8)
    places = np.array([place(x * 0.43, y * 0.43) for x in range(20) for y in range(16)])
    share = picture_of([quad(0, 0.3, 0, 0.3, texture=texture, transforms=places)])[..., 3]
    assert share.sum() == pytest.approx(len(places) * 9 * disc.mean(), rel=0.03)


def test_the_texture_lies_upright_and_repeats():
    texture = np.full((2, 2, 4), 255, np.uint8)
    texture[0, 0, :3] = [255, 0, 0]  # top left of the image is v = 1, u = 0
    square = quad(0, 4, 0, 4, texture=texture)
    picture = picture_of([square])
    assert_allclose(picture[70, 40, :3], [1, 0, 0], atol=0.08)  # half a pixel beside the texel's centre
    assert_allclose(picture[90, 40, :3], [1, 1, 1], atol=0.03)
    twice = Drawable(name="r", points=square.points, faces=square.faces, uv=square.uv * 2, texture=texture)
    again = picture_of([twice])
    for row, column in ((65, 35), (85, 35), (65, 55)):
        assert_allclose(again[row, column, :3], [1, 0, 0], atol=0.16)


def test_what_is_nearer_hides_what_is_behind_from_every_side():
    red, blue = quad(-2, 2, 1, 4, z=1, colour=[1, 0, 0, 1]), quad(-2, 2, 1, 4, z=-1, colour=[0, 0, 1, 1])
    for azimuth, colour in ((0.0, [1, 0, 0]), (np.pi, [0, 0, 1])):  # from behind: back faces show as well
        for focal_px in (None, 500.0):
            camera = Camera((100, 100), (50.0, 90.0), 15.0, azimuth, 0.0, focal_px)
            assert_allclose(picture_of([red, blue], camera)[55, 50, :3], colour, atol=0.01)


def test_classes_tell_leaf_from_wood_by_what_is_in_front():
    wood, leaf = quad(0, 8, 0, 2), quad(4, 12, 0, 2, z=1, is_leaf=True, colour=[0.1, 0.9, 0.1, 1])
    with Studio([wood, leaf]) as studio:
        before = studio.colour(CAMERA)
        front = studio.classes(CAMERA)
        assert (studio.colour(CAMERA) == before).all()  # the class picture changes nothing for good
    assert front[..., 0].sum() == pytest.approx(80 * 20)
    assert front[..., 1].sum() == pytest.approx(40 * 20)


def test_instances_stand_where_their_transforms_put_them():
    places = np.array([place(1, 1), place(6, 2, scale=2.0)])
    share = picture_of([quad(0, 1, 0, 1, transforms=places)])[..., 3]
    expected = np.zeros_like(share)
    expected[80:90, 40:50] = 1
    expected[60:80, 90:110] = 1
    assert (share == expected).all()


def test_pictures_do_not_depend_on_what_was_drawn_before():
    first, second = quad(1, 6, 2, 5), quad(0, 3, 0, 3, texture=np.full((4, 4, 4), 200, np.uint8))
    wide = Camera((311, 97), (20.0, 90.0), 9.0)
    with Studio([first, second]) as studio:
        once = studio.colour(CAMERA)
        studio.lit(wide)
        assert (studio.colour(CAMERA) == once).all()
        assert studio.colour(wide).shape == (97, 311, 4)


def test_nothing_to_draw_is_an_empty_picture():
    with Studio([]) as studio:
        assert not studio.colour(CAMERA).any()
        assert not studio.classes(CAMERA).any()
        assert not studio.lit(CAMERA).any()


def test_the_lit_picture_covers_what_the_flat_one_covers_and_shades_from_both_sides():
    wall = quad(-3, 3, 0, 5, colour=[0.6, 0.6, 0.6, 1])
    for azimuth in (0.0, np.pi):
        camera = frame_camera([wall], azimuth=azimuth, size=(90, 100))
        with Studio([wall]) as studio:
            lit, flat = studio.lit(camera), studio.colour(camera)
        assert (lit[..., 3] == flat[..., 3]).all()
        assert 0.3 < lit[50, 45, 1] <= 1


def test_the_sun_casts_a_shadow_down_to_the_viewers_right():
    floor, roof = quad(-5, 5, -5, 5), quad(-1, 1, -1, 1, z=2.0, colour=[1, 1, 1, 1])
    with Studio([floor, roof]) as studio:
        lit = studio.lit(Camera((200, 200), (100.0, 100.0), 20.0))
    shadow, open_floor = lit[147, 137, 1], lit[40, 40, 1]  # the roof's shadow falls 1.8 m right, 2.3 m down
    assert shadow < 0.8 * open_floor


def test_frame_camera_shows_everything_and_no_more():
    tree = quad(-2, 4, 0, 9)
    camera = frame_camera([tree], azimuth=0.0, size=(300, 200), margin=0.1)
    share = picture_of([tree], camera)[..., 3]
    rows = np.flatnonzero(share.any(axis=1))
    columns = np.flatnonzero(share.any(axis=0))
    assert (rows[0], rows[-1]) == (20, 179)
    assert abs((columns[0] + columns[-1] + 1) / 2 - 150) <= 1


def test_from_above_right_is_right_and_the_photos_far_side_is_up():
    camera = frame_camera([quad(-2, 2, 0, 2)], azimuth=0.0, elevation=QUARTER, size=(100, 100))
    right, far = camera.project([[1, 0, 0], [0, 0, -1]]) - camera.project([[0, 0, 0]])
    assert right[0] > 0
    assert far[1] < 0


def test_extent_covers_every_instance():
    turned = np.array([[0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], float)
    drawable = quad(0, 2, 0, 1, transforms=np.array([np.eye(4), turned]))
    assert_allclose(extent_along([drawable], np.eye(3)), [[0, 0, 0], [5, 2, 0]])
    with pytest.raises(ValueError, match="nothing to draw"):
        extent_along([], np.eye(3))


def test_projection_matrix_agrees_with_the_camera():
    rng = np.random.default_rng(1)
    for focal_px in (None, 900.0):
        camera = Camera((640, 480), (100.0, 470.0), 30.0, 0.4, 0.1, focal_px)
        points = rng.uniform(-3, 3, (50, 3))
        clip = np.column_stack([points @ camera_pose(camera)[:3, :3], np.ones(50)]) @ projection(camera, 6, -6).T
        ndc = clip[:, :3] / clip[:, 3:]
        px = (ndc[:, :2] * [1, -1] + 1) / 2 * camera.size
        assert_allclose(px, camera.project(points), atol=1e-9)
        assert (np.abs(ndc[:, 2]) < 1).all()
        nearer = np.argsort(camera.depth(points))[::-1]
        assert (np.diff(ndc[nearer, 2]) > 0).all()


def test_clip_depth_undoes_pyrenders_linearisation():
    clip = np.array([-0.99, -0.2, 0.0, 0.7])
    linear = 2 * NEAR * FAR / (FAR + NEAR - clip * (FAR - NEAR))
    assert_allclose(clip_depth(np.append(linear, 0.0).astype(np.float32)), [*clip, 1.0], atol=1e-5)


def test_the_sun_looks_from_the_viewers_left_above():
    viewer = Camera((10, 10), (5.0, 5.0), 1.0, azimuth=1.0)
    toward = sun_camera([quad(-1, 1, 0, 1)], viewer).axes[2] @ viewer.axes.T
    assert toward[0] < 0 < toward[1]
    assert toward[2] > 0


def test_vertex_normals_of_a_flat_sheet_point_up():
    normals = vertex_normals(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9]], float), np.array([[0, 1, 2]]))
    assert_allclose(normals, [[0, 0, 1]] * 4)  # a point without a face gets +Z


def test_faces_outside_the_points_are_refused():
    with pytest.raises(ValueError, match="faces point outside"):
        Drawable(name="bad", points=np.zeros((2, 3)), faces=[[0, 1, 2]])


def test_without_opengl_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyrender", None)
    with pytest.raises(RenderError, match="apt-get install -y libgl1 libegl1 libgl1-mesa-dri"):
        Studio([])


def test_without_a_device_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setenv("EGL_DEVICE_ID", "4711")
    with pytest.raises(RenderError, match="apt-get install"):
        Studio([])


def test_of_two_equally_far_surfaces_the_first_one_wins_in_every_run():
    """The order of drawing must not be that of addresses in memory."""
    colours = np.eye(8, 4)[:, :4] * 0.5 + [0.1, 0.2, 0.3, 1.0]
    for _ in range(5):
        clutter = [object() for _ in range(37)]  # moves what is made next to other addresses
        same = [quad(1, 6, 2, 5, colour=np.minimum(colour, 1)) for colour in colours]
        assert_allclose(picture_of(same)[60, 60, :3], colours[0][:3], atol=0.003)
        del clutter
