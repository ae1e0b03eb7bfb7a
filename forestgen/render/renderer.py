"""The studio's renderer: pyrender's, with our shaders and sun, a fixed order, and a picture of what is in front."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

SHADERS = Path(__file__).parent / "shaders"


def studio_renderer(pyrender: Any) -> Any:
    """A pyrender renderer that draws with our programs, and in the order of the drawables.

    pyrender draws a set of nodes in the order of their addresses: where two surfaces are equally far,
    another one would win in each run.
    """
    from OpenGL import GL

    class StudioRenderer(pyrender.Renderer):  # type: ignore[misc]
        keeps_classes = False  # whether an unlit drawing fills `classes` too
        classes: Any = None  # (H, W, 2) uint8, shares of leaf and wood in front
        sun_texture: Any = None
        sun_matrix: Any = None  # (4, 4) world to the sun's clip space
        sun_toward: Any = None  # (3,) unit, towards the sun

        def __init__(self, width: int, height: int) -> None:
            super().__init__(width, height)
            caches = (
                pyrender.shader_program.ShaderProgramCache(str(folder)) for folder in (SHADERS, SHADERS / "shadow")
            )
            self._seen_programs, self._shadow_programs = caches
            self._program_cache = self._seen_programs
            self._class_buffers: list[int] = []  # four samples a pixel, and one

        def shadow_depth(self, draw: Any) -> Any:
            """What `draw()` answers when it runs with the programs of the sun's view."""
            self._program_cache = self._shadow_programs
            try:
                return draw()
            finally:
                self._program_cache = self._seen_programs

        def _sorted_mesh_nodes(self, scene: Any) -> list[Any]:
            return sorted(scene.mesh_nodes, key=lambda node: int(node.mesh.name))

        def _bind_lighting(self, scene: Any, program: Any, node: Any, flags: int) -> None:
            self._bind_texture(self.sun_texture, "sun_depth", program)
            program.set_uniform("sun_matrix", self.sun_matrix)
            program.set_uniform("sun_toward", self.sun_toward)

        def _configure_main_framebuffer(self) -> None:
            super()._configure_main_framebuffer()
            GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._main_fb_ms)
            if not self.keeps_classes:
                GL.glDrawBuffer(GL.GL_COLOR_ATTACHMENT0)
                return
            if not self._class_buffers:
                self._add_class_buffers()
            GL.glDrawBuffers(2, [GL.GL_COLOR_ATTACHMENT0, GL.GL_COLOR_ATTACHMENT1])

        def _add_class_buffers(self) -> None:
            size = self.viewport_width, self.viewport_height
            self._class_buffers = [int(name) for name in GL.glGenRenderbuffers(2)]
            for framebuffer, buffer, samples in zip(
                (self._main_fb, self._main_fb_ms), self._class_buffers, (0, 4), strict=True
            ):
                GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
                GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, samples, GL.GL_RGBA, *size)
                GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, framebuffer)
                GL.glFramebufferRenderbuffer(
                    GL.GL_DRAW_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT1, GL.GL_RENDERBUFFER, buffer
                )

        def _delete_main_framebuffer(self) -> None:
            super()._delete_main_framebuffer()
            if self._class_buffers:
                GL.glDeleteRenderbuffers(2, self._class_buffers)
            self._class_buffers = []

        def _read_main_framebuffer(self, scene: Any, flags: int) -> Any:
            read = super()._read_main_framebuffer(scene, flags)
            self.classes = self._read_classes() if self.keeps_classes else None
            return read

        def _read_classes(self) -> Any:
            width, height = self._main_fb_dims
            box = (0, 0, width, height)
            GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb_ms)
            GL.glReadBuffer(GL.GL_COLOR_ATTACHMENT1)
            GL.glDrawBuffer(GL.GL_COLOR_ATTACHMENT1)  # of the framebuffer of one sample
            GL.glBlitFramebuffer(*box, *box, GL.GL_COLOR_BUFFER_BIT, GL.GL_NEAREST)
            GL.glReadBuffer(GL.GL_COLOR_ATTACHMENT0)
            GL.glDrawBuffer(GL.GL_COLOR_ATTACHMENT0)
            GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb)
            GL.glReadBuffer(GL.GL_COLOR_ATTACHMENT1)
            pixels = GL.glReadPixels(*box, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE)
            GL.glReadBuffer(GL.GL_COLOR_ATTACHMENT0)
            return np.frombuffer(pixels, np.uint8).reshape(height, width, 4)[::-1, :, :2]

    return StudioRenderer(16, 16)
