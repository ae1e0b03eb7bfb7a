"""Drawing of triangles offscreen through a `Camera`; knows nothing of USD. The only folder that imports pyrender."""

from forestgen.render.drawable import Drawable, frame_camera
from forestgen.render.studio import Studio, gl_description

__all__ = ["Drawable", "Studio", "frame_camera", "gl_description"]
