"""Studio: pyrender offscreen, with its known faults worked around. One context for many pictures.

What pyrender gets wrong is replaced, not patched: its shaders (they never discard cut-out texels)
by our own; its cameras (its orthographic one takes no offset) by exact matrices; its lights by one
sun with a shadow map of ours. Its depth linearisation is undone, its bounds (`np.infty`) are not used.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.errors import RenderError
from forestgen.render.drawable import Drawable, extent_along
from forestgen.render.projection import camera_pose, projection
from forestgen.render.renderer import studio_renderer
from forestgen.render.sunlight import FAR, NEAR, clip_depth, depth_texture, sun_camera
from forestgen.tree.model import vertex_normals

REMEDY = "OpenGL without a screen is missing; on Debian: apt-get install -y libgl1 libegl1 libgl1-mesa-dri"


def _pyrender() -> Any:
    """Import pyrender on EGL, which needs no screen.

    Raises:
        RenderError: OpenGL is not there.
    """
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    try:
        import pyglet

        pyglet.options["headless"] = True  # pyrender's viewer, never shown, would ask for X libraries
        import pyrender  # noqa: TID251 - this is the one place
        import pyrender.shader_program  # noqa: TID251
    except Exception as error:  # PyOpenGL fails in many ways where a library is missing
        raise RenderError(f"{REMEDY} ({type(error).__name__}: {error})") from error
    return pyrender


class Studio:
    """Draws one set of drawables through any number of cameras. Use as a context manager, one at a time.

    Four samples a pixel; unlit, each is shaded by itself. Pictures come as premultiplied shares: a pixel
    half covered by white is (0.5, 0.5, 0.5, 0.5).
    """

    def __init__(self, drawables: Sequence[Drawable]) -> None:
        self._drawables = [d for d in drawables if len(d.faces) and len(d.transforms)]
        self._pyrender = _pyrender()
        try:
            self._offscreen = self._pyrender.OffscreenRenderer(16, 16)
        except Exception as error:  # EGL answers with assertions, attribute and GL errors
            raise RenderError(f"{REMEDY} ({type(error).__name__}: {error})") from error
        self._renderer = self._offscreen._renderer = studio_renderer(self._pyrender)
        self._scene = self._pyrender.Scene(bg_color=[0.0, 0.0, 0.0, 0.0])
        textures: dict[int, Any] = {}  # one for all leaves over an atlas
        for index, drawable in enumerate(self._drawables):
            self._scene.add(_mesh(self._pyrender, drawable, str(index), textures))
        self._camera_node: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._offscreen.delete()

    def colour(self, camera: Camera) -> NDArray[np.float32]:
        """Draw the textures' own colours, unlit: premultiplied sRGB-encoded RGBA (H, W, 4) in [0, 1]."""
        return self._draw(camera, self._pyrender.RenderFlags.FLAT)[0]

    def classes(self, camera: Camera) -> NDArray[np.float32]:
        """Shares (H, W, 2) of each pixel where a leaf, and where wood, is in front."""
        return self.colour_and_classes(camera)[1]

    def colour_and_classes(self, camera: Camera) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """What `colour` and `classes` give, drawn at once."""
        self._renderer.keeps_classes = True
        try:
            colour, _ = self._draw(camera, self._pyrender.RenderFlags.FLAT)
        finally:
            self._renderer.keeps_classes = False
        classes = self._renderer.classes if self._drawables else np.zeros((*colour.shape[:2], 2), np.uint8)
        return colour, np.asarray(classes, np.float32) / np.float32(255)

    def lit(self, camera: Camera) -> NDArray[np.float32]:
        """Draw in soft studio light, for people: premultiplied sRGB-encoded RGBA (H, W, 4) in [0, 1]."""
        if not self._drawables:
            return self.colour(camera)
        sun = sun_camera(self._drawables, camera)
        depth = self._renderer.shadow_depth(lambda: self._draw(sun, self._pyrender.RenderFlags.FLAT)[1])
        texture = depth_texture(self._pyrender, clip_depth(depth))
        texture._add_to_context()
        self._renderer.sun_texture = texture
        self._renderer.sun_matrix = self._clip_matrix(sun) @ np.linalg.inv(camera_pose(sun))
        self._renderer.sun_toward = sun.axes[2]
        try:
            return self._draw(camera, self._pyrender.RenderFlags.NONE)[0]
        finally:
            texture.delete()

    def _clip_matrix(self, camera: Camera) -> NDArray[np.float64]:
        """The camera's projection, its clipping planes just around what is drawn."""
        farthest, nearest = extent_along(self._drawables, camera.axes[2:])[:, 0]
        slack = 0.01 * (nearest - farthest) + 1e-3
        return projection(camera, nearest + slack, farthest - slack)

    def _draw(self, camera: Camera, flags: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """RGBA (H, W, 4) in [0, 1], and pyrender's depth (H, W)."""
        width, height = camera.size
        if not self._drawables:
            return np.zeros((height, width, 4), np.float32), np.zeros((height, width), np.float32)
        if self._camera_node is not None:
            self._scene.remove_node(self._camera_node)
        exact = _exact_camera(self._pyrender, self._clip_matrix(camera))
        self._camera_node = self._scene.add(exact, pose=camera_pose(camera))
        self._offscreen.viewport_width, self._offscreen.viewport_height = width, height
        picture, depth = self._offscreen.render(self._scene, flags=flags | self._pyrender.RenderFlags.RGBA)
        return np.asarray(picture, np.float32) / np.float32(255), depth


def _exact_camera(pyrender: Any, matrix: NDArray[np.float64]) -> Any:
    """A pyrender camera that answers with the given projection matrix."""

    class ExactCamera(pyrender.Camera):  # type: ignore[misc]
        def get_projection_matrix(self, width: int | None = None, height: int | None = None) -> NDArray[np.float64]:
            return matrix

    return ExactCamera(znear=NEAR, zfar=FAR)


def _mesh(pyrender: Any, drawable: Drawable, name: str, textures: dict[int, Any]) -> Any:
    """One pyrender mesh: instances by poses; drawn from both sides; threshold and class ride on unused factors.

    `textures` remembers pyrender's by the array that they hold.
    """
    texture = None
    if drawable.texture is not None and drawable.uv is not None:
        key = id(drawable.texture)
        if key not in textures:
            textures[key] = pyrender.Texture(source=drawable.texture, source_channels="RGBA")
        texture = textures[key]
    threshold = drawable.alpha_threshold if drawable.alpha_threshold > 0 else 0.5
    material = pyrender.MetallicRoughnessMaterial(
        baseColorFactor=drawable.colour,
        baseColorTexture=texture,
        metallicFactor=threshold,
        roughnessFactor=float(drawable.is_leaf),
        alphaMode="MASK",
        doubleSided=True,
    )
    normals = drawable.normals
    if normals is None:
        normals = vertex_normals(drawable.points, drawable.faces)
    primitive = pyrender.Primitive(
        positions=drawable.points,
        normals=normals,
        texcoord_0=drawable.uv,
        indices=drawable.faces,
        material=material,
        mode=pyrender.GLTF.TRIANGLES,
        poses=drawable.transforms,
    )
    return pyrender.Mesh(primitives=[primitive], name=name)


def gl_description() -> str:
    """What draws here: OpenGL's renderer and version, in one line.

    Raises:
        RenderError: OpenGL is not there.
    """
    with Studio([]):
        from OpenGL.GL import GL_RENDERER, GL_VERSION, glGetString

        return " ".join(glGetString(name).decode() for name in (GL_RENDERER, GL_VERSION))
