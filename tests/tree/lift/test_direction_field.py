"""Direction fields: equation 3 by hand, interpolation, and the graph's points and tangents."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from forestgen.tree.lift.direction_field import Blend, DirectionField, blending, direction_field, graph_points

# one segment, from the root at the foot of the picture straight up
XY = np.array([[50.0, 90.0], [50.0, 10.0]])
PARENT = np.array([-1, 0])
BOX = np.array([[0.0, 0.0], [100.0, 100.0]])


def at(x: float, y: float, *, blend: Blend = "linear", share: float = 0.5) -> NDArray[np.float64]:
    field = direction_field(XY, PARENT, BOX, reach=40.0, blend=blend, share=share)
    return np.asarray(field.at(np.array([[x, y]]))[0])


def test_on_the_graph_the_field_is_its_tangent_to_the_root() -> None:
    assert_allclose(at(50, 50), [0, 1], atol=0.03)


def test_far_from_the_graph_a_linear_field_points_straight_to_it() -> None:
    assert_allclose(at(5, 50), [1, 0], atol=1e-3)
    assert_allclose(at(95, 50), [-1, 0], atol=1e-3)


def test_half_way_a_linear_field_is_half_vector_half_tangent() -> None:
    assert_allclose(at(30, 50), [0.5, 0.5], atol=1e-3)


@pytest.mark.parametrize("x", [10.0, 30.0, 45.0])
def test_a_constant_field_keeps_its_angle_at_every_distance(x: float) -> None:
    assert_allclose(at(x, 50, blend="constant", share=0.25), [0.25, 0.75], atol=1e-3)


def test_below_the_root_the_field_leads_back_up() -> None:
    assert at(50, 99)[1] < 0.8  # the vector to the root counts against the tangent
    field = direction_field(XY, PARENT, BOX, reach=5.0)
    assert_allclose(field.at(np.array([[50.0, 98.0]]))[0], [0, -1], atol=0.02)


def test_the_blending_functions() -> None:
    d = np.array([0.0, 5.0, 10.0, 30.0])
    assert_allclose(blending(d, "linear", 10.0, 0.3), [0, 0.5, 1, 1])
    assert_allclose(blending(d, "constant", 10.0, 0.3), [0, 0.3, 0.3, 0.3])


def test_between_corners_the_field_is_bilinear_and_outside_it_the_border_counts() -> None:
    vector = np.zeros((2, 2, 2))
    vector[0, 1, 0] = vector[1, 0, 1] = 1
    field = DirectionField(vector, np.zeros(2), np.array([10.0, 20.0]))
    at_places = field.at(np.array([[5.0, 5], [10, 0], [-9, 99], [2.5, 10]]))
    assert_allclose(at_places, np.array([[0.375, 0.125], [1, 0], [0, 1], [0.125, 0.375]]))


def test_points_of_a_graph_are_no_farther_apart_than_asked_and_look_to_the_root() -> None:
    xy = np.array([[0.0, 0], [0, 10], [6, 18]])
    place, tangent, node = graph_points(xy, np.array([-1, 0, 1]), 2.0)
    assert len(place) == 1 + 5 + 5
    assert_array_equal(node, [0, *[1] * 5, *[2] * 5])
    assert_allclose(place[0], [0, 0])
    assert_allclose(tangent[1:6], np.tile([0, -1], (5, 1)))
    assert_allclose(tangent[6:], np.tile([-0.6, -0.8], (5, 1)))


def test_a_graph_of_the_root_alone_draws_everything_to_it() -> None:
    field = direction_field(XY[:1], PARENT[:1], BOX, reach=10.0)
    assert_allclose(field.at(np.array([[50.0, 30.0], [10, 90]])), [[0, 1], [1, 0]], atol=0.01)
