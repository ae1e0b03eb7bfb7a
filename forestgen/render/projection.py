"""Camera to OpenGL: the 4 x 4 matrices that put a point on the very pixel that `Camera.project` names."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera


def camera_pose(camera: Camera) -> NDArray[np.float64]:
    """Camera to world (4, 4): turned as the camera is, at the tree's root."""
    pose = np.eye(4)
    pose[:3, :3] = camera.axes.T
    return pose


def projection(camera: Camera, nearest: float, farthest: float) -> NDArray[np.float64]:
    """Clip coordinates (4, 4) of points given in the camera's axes, with the root as the origin.

    `nearest` > `farthest`: `Camera.depth` of the two clipping planes, metres. A perspective
    camera clips what is behind a hundredth of its distance.
    """
    width, height = camera.size
    root = np.array(camera.root_px)
    centre = np.array(camera.size) / 2
    matrix = np.zeros((4, 4))
    matrix[0, 0] = 2 * camera.px_per_metre / width
    matrix[1, 1] = 2 * camera.px_per_metre / height
    shift = 2 * (root - centre) / [width, height] * [1, -1]
    matrix[:2, 3] = shift
    matrix[3, 3] = 1.0
    if camera.focal_px is None:
        middle, half = (nearest + farthest) / 2, (nearest - farthest) / 2
        matrix[2, 2], matrix[2, 3] = -1 / half, middle / half
        return matrix
    near, far = _planes(camera.distance, nearest, farthest)
    # w = (distance - z) / distance, and clip z is linear in z with -w at the near plane, w at the far one
    matrix[3, 2] = -1 / camera.distance
    w_near, w_far = near / camera.distance, far / camera.distance
    matrix[2, 2] = -(w_far + w_near) / (far - near)
    matrix[2, 3] = -w_near - matrix[2, 2] * (camera.distance - near)
    return matrix


def _planes(distance: float, nearest: float, farthest: float) -> tuple[float, float]:
    """Distances of the near and the far plane in front of a perspective camera, metres."""
    near = max(distance - nearest, distance / 100)
    return near, max(distance - farthest, near * 1.01)
