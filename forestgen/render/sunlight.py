"""The studio's sun: where it stands for a viewer, and the shadow map that it casts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.render.drawable import Drawable, frame_camera

FROM_VIEWER = (-0.55, 0.70, 0.60)  # towards the sun in the viewer's right, up and back: over the left shoulder
MAP_PX = 512  # side of the shadow map
NEAR, FAR = 1.0, 2.0  # what pyrender takes the clipping planes to be when it linearises depth


def sun_camera(drawables: Sequence[Drawable], viewer: Camera) -> Camera:
    """The orthographic camera that looks at all drawables from the sun."""
    toward = np.array(FROM_VIEWER) / np.linalg.norm(FROM_VIEWER) @ viewer.axes
    azimuth, elevation = np.arctan2(toward[0], toward[2]), np.arcsin(np.clip(toward[1], -1, 1))
    return frame_camera(
        drawables, azimuth=float(azimuth), elevation=float(elevation), size=(MAP_PX, MAP_PX), margin=0.02
    )


def clip_depth(linear: NDArray[np.float32]) -> NDArray[np.float64]:
    """Undo pyrender's perspective linearisation of depth: clip depth in [-1, 1], 1 where nothing is."""
    drawn = linear > 0
    safe = np.where(drawn, linear.astype(np.float64), 1.0)
    return np.where(drawn, (FAR + NEAR - 2 * NEAR * FAR / safe) / (FAR - NEAR), 1.0)


def depth_texture(pyrender: Any, depth: NDArray[np.float64]) -> Any:
    """Clip depth (H, W) as a texture that keeps 16 bits of it in red and green."""
    from OpenGL.GL import GL_CLAMP_TO_EDGE, GL_NEAREST

    steps = np.round(np.clip(depth * 0.5 + 0.5, 0, 1) * 65535).astype(np.uint16)
    rgb = np.dstack([steps >> 8, steps & 255, np.zeros_like(steps)]).astype(np.uint8)
    sampler = pyrender.Sampler(
        minFilter=GL_NEAREST, magFilter=GL_NEAREST, wrapS=GL_CLAMP_TO_EDGE, wrapT=GL_CLAMP_TO_EDGE
    )
    return pyrender.Texture(source=rgb, source_channels="RGB", sampler=sampler)
