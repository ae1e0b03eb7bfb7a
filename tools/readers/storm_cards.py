"""Storm, USD's own renderer, draws an asset in one of its draw modes. Runs in Blender's own Python, which brings it:

    python storm_cards.py FILE MODE OUT_FOLDER

Writes OUT_FOLDER/XPos.png ... ZNeg.png: the default prim in that mode (cards, default), seen before each face.
"""

import ctypes
import os
import sys

PX, METRES = 300, 6.0
FACES = {"ZPos": (0, 0), "XPos": (90, 0), "ZNeg": (180, 0), "XNeg": (-90, 0), "YPos": (0, 90), "YNeg": (0, -90)}


def make_context() -> None:
    """An OpenGL 4.5 context without a screen, by EGL's surfaceless platform, with a buffer to be current on."""
    egl = ctypes.CDLL("libEGL.so.1")
    pointer, ints = ctypes.c_void_p, lambda *values: (ctypes.c_int * len(values))(*values)
    for function in ("eglGetProcAddress", "eglCreatePbufferSurface", "eglCreateContext"):
        getattr(egl, function).restype = pointer
    get_display = ctypes.CFUNCTYPE(pointer, ctypes.c_uint, pointer, pointer)(
        egl.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
    )
    display = pointer(get_display(0x31DD, None, None))  # EGL_PLATFORM_SURFACELESS_MESA
    config, count = pointer(), ctypes.c_int()
    wanted = ints(0x3040, 0x0008, 0x3033, 1, 0x3024, 8, 0x3023, 8, 0x3022, 8, 0x3021, 8, 0x3025, 24, 0x3038)
    if not (egl.eglInitialize(display, None, None) and egl.eglBindAPI(0x30A2)):
        sys.exit("EGL without a screen is missing")
    egl.eglChooseConfig(display, wanted, ctypes.byref(config), 1, ctypes.byref(count))
    surface = pointer(egl.eglCreatePbufferSurface(display, config, ints(0x3057, PX, 0x3056, PX, 0x3038)))
    context = pointer(egl.eglCreateContext(display, config, None, ints(0x3098, 4, 0x30FB, 5, 0x3038)))
    if not egl.eglMakeCurrent(display, surface, surface, context):
        sys.exit("OpenGL 4.5 without a screen is missing")


def main() -> None:
    """Set the mode, draw six pictures."""
    make_context()
    import bpy

    bpy.utils.expose_bundled_modules()
    from pxr import Gf, Usd, UsdAppUtils, UsdGeom  # noqa: TID251 - Blender's own

    file, mode, out = sys.argv[1:]
    stage = Usd.Stage.Open(file)
    UsdGeom.ModelAPI(stage.GetDefaultPrim()).GetModelDrawModeAttr().Set(mode)
    recorder = UsdAppUtils.FrameRecorder()
    recorder.SetImageWidth(PX)
    for face, (azimuth, elevation) in FACES.items():
        camera = UsdGeom.Camera.Define(stage, f"/before_{face}")
        camera.CreateProjectionAttr(UsdGeom.Tokens.orthographic)
        camera.CreateHorizontalApertureAttr(10 * METRES)  # tenths of a scene unit
        camera.CreateVerticalApertureAttr(10 * METRES)
        camera.CreateClippingRangeAttr(Gf.Vec2f(0.1, 100))
        turn = Gf.Rotation(Gf.Vec3d.XAxis(), -elevation) * Gf.Rotation(Gf.Vec3d.YAxis(), azimuth)
        back, up = (Gf.Matrix4d().SetTranslate(Gf.Vec3d(*at)) for at in ((0, 0, 20), (0, METRES / 3, 0)))
        camera.AddTransformOp().Set(back * Gf.Matrix4d().SetRotate(turn) * up)
        recorder.Record(stage, camera, Usd.TimeCode.Default(), os.path.join(out, f"{face}.png"))


main()
