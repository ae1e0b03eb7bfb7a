"""Arrays, generators and the camera: what everything else stands on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from forestgen.arrays import freeze, stage_rng
from forestgen.camera import Camera


@dataclass(frozen=True, eq=False)
class Pair:
    """Two arrays that must be equally long."""

    place: NDArray[np.float64]  # (N, 2)
    label: NDArray[np.int64]  # (N,)

    def __post_init__(self) -> None:
        freeze(self, place=(np.float64, "N", 2), label=(np.int64, "N"))


def test_freeze_coerces_and_makes_read_only() -> None:
    pair = Pair([[1, 2], [3, 4]], [0, 1])  # type: ignore[arg-type]
    assert pair.place.dtype == np.float64
    assert pair.label.dtype == np.int64
    with pytest.raises(ValueError, match="read-only"):
        pair.place[0, 0] = 5


def test_freeze_leaves_the_callers_array_alone() -> None:
    place = np.zeros((2, 2))
    pair = Pair(place, np.zeros(2, np.int64))
    place[0, 0] = 7  # still the caller's to write
    assert pair.place[0, 0] == 0
    assert Pair(pair.place, pair.label).place is pair.place  # frozen already: no copy


@pytest.mark.parametrize(
    ("place", "label", "message"),
    [
        (np.zeros((2, 3)), np.zeros(2), r"Pair.place has shape \(2, 3\); expected \(N, 2\)"),
        (np.zeros(4), np.zeros(2), r"Pair.place has shape \(4,\); expected \(N, 2\)"),
        (np.zeros((2, 2)), np.zeros(3), "Pair.label has N = 3, but Pair.place has N = 2"),
        (np.full((1, 2), np.inf), np.zeros(1), "Pair.place holds an infinite value"),
    ],
)
def test_freeze_names_what_does_not_fit(place: NDArray[np.float64], label: NDArray[np.float64], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Pair(place, label)  # type: ignore[arg-type]


def test_freeze_lets_unknown_values_stand() -> None:
    assert np.isnan(Pair(np.full((1, 2), np.nan), np.zeros(1, np.int64)).place).all()


def test_each_stage_has_a_generator_of_its_own() -> None:
    first = stage_rng(7, "grow").random(4)
    assert_array_equal(first, stage_rng(7, "grow").random(4))
    for other in (stage_rng(8, "grow"), stage_rng(7, "leaves"), stage_rng(7, "grow", 1), stage_rng(7, "grow", 2)):
        assert not np.allclose(first, other.random(4))


# Every kind of camera: both models, from the front, from around, from above, and with a root off centre.
CAMERAS = [
    Camera((400, 300), (200.0, 280.0), 40.0),
    Camera((400, 300), (120.5, 290.0), 40.0, azimuth=1.0),
    Camera((400, 300), (120.5, 290.0), 25.0, azimuth=-2.0, elevation=0.3),
    Camera((400, 300), (230.0, 260.0), 40.0, focal_px=500.0),
    Camera((400, 300), (230.0, 260.0), 40.0, azimuth=2.5, elevation=-0.2, focal_px=900.0),
]


@pytest.mark.parametrize("camera", CAMERAS)
def test_projection_and_back(camera: Camera) -> None:
    points = np.random.default_rng(3).uniform(-3, 3, (200, 3))
    again = camera.unproject(camera.project(points), camera.depth(points))
    assert_allclose(again, points, atol=1e-9)


@pytest.mark.parametrize("camera", CAMERAS)
def test_root_falls_where_it_was_said_to(camera: Camera) -> None:
    assert_allclose(camera.project([[0, 0, 0]]), [camera.root_px], atol=1e-9)


@pytest.mark.parametrize("camera", CAMERAS)
def test_axes_are_a_right_handed_frame(camera: Camera) -> None:
    right, up, back = camera.axes
    assert_allclose(camera.axes @ camera.axes.T, np.eye(3), atol=1e-12)
    assert_allclose(np.cross(right, up), back, atol=1e-12)


@pytest.mark.parametrize(
    ("azimuth_deg", "seat"), [(0, [0, 0, 1]), (90, [1, 0, 0]), (180, [0, 0, -1]), (270, [-1, 0, 0])]
)
def test_azimuth_turns_anticlockwise_seen_from_above(azimuth_deg: float, seat: list[float]) -> None:
    camera = Camera((100, 100), (50.0, 90.0), 10.0, azimuth=np.deg2rad(azimuth_deg))
    assert_allclose(camera.axes[2], seat, atol=1e-12)  # the camera's side of the tree
    assert camera.depth([seat])[0] == pytest.approx(1)  # what stands there is a metre nearer


def test_pictures_of_a_known_point() -> None:
    point = [[1.0, 2.0, 0.0]]  # one metre to the right, two up
    front = Camera((100, 100), (50.0, 90.0), 10.0)
    assert_allclose(front.project(point), [[60, 70]])  # px grow rightwards and downwards
    from_x = Camera((100, 100), (50.0, 90.0), 10.0, azimuth=np.pi / 2)
    assert_allclose(from_x.project(point), [[50, 70]], atol=1e-12)  # seen end on, nearer to the camera
    assert_allclose(from_x.project([[0, 0, -1]]), [[60, 90]], atol=1e-12)  # -Z lies to the right from +X
    above = Camera((100, 100), (50.0, 50.0), 10.0, elevation=np.pi / 2)
    assert_allclose(above.project([[0, 5, 1]]), [[50, 60]], atol=1e-12)  # +Z lies below the root, height is not seen


def test_perspective_shows_near_things_larger() -> None:
    camera = Camera((400, 300), (200.0, 150.0), 40.0, focal_px=400.0)
    assert camera.distance == pytest.approx(10)
    near, far = camera.project([[1, 0, 5], [1, 0, -10]])
    assert_allclose(near, [280, 150])  # at half the distance twice as large
    assert_allclose(far, [220, 150])
    assert Camera((4, 3), (2.0, 1.0), 1.0).distance == np.inf


@pytest.mark.parametrize("scale", [0.0, -3.0, np.nan, np.inf])
def test_camera_wants_a_positive_scale(scale: float) -> None:
    with pytest.raises(ValueError, match="px_per_metre"):
        Camera((100, 100), (50.0, 90.0), scale)


@pytest.mark.parametrize("focal", [0.0, -1.0, np.nan])
def test_camera_wants_a_positive_focal_length(focal: float) -> None:
    with pytest.raises(ValueError, match="focal_px"):
        Camera((100, 100), (50.0, 90.0), 10.0, focal_px=focal)
