"""A growing tree in the report: a strip of its ages, and a moving preview (APNG), both drawn from the written stage."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.check import pictures
from forestgen.check.report import PictureFile
from forestgen.png import write_png
from forestgen.render import Studio, frame_camera
from forestgen.usd.read import read_drawables, read_film

SIZE = (280, 320)  # px of a picture
AGES = 8  # pictures in the strip
MOVES = 24  # pictures of the preview
SECONDS = 4.0  # how long it runs
REST = 1.5  # seconds that it stays on the finished tree
STRIP, PREVIEW = "growth_strip.png", "growth.png"  # in report/<tree>/

Picture = NDArray[np.uint8]


def draw_film(stage: Path, frames: int, folder: Path, on_picture: Callable[[int, int], None] | None = None) -> None:
    """Draw a stage that grows over frames 1 .. `frames` into `folder`: STRIP and PREVIEW.

    Raises:
        RenderError: no OpenGL to render with.
        OSError: a picture could not be written.
    """
    camera = frame_camera(read_drawables(stage), azimuth=0.0, elevation=0.0, size=SIZE, margin=0.07)
    times = np.unique(np.round(np.linspace(1, frames, min(frames, MOVES))))
    shown: list[Picture] = []
    for drawables in read_film(stage, times.tolist()):
        with Studio(drawables) as studio:
            shown.append(pictures.portrait_picture(studio.lit(camera), foot=camera.root_px))
        if on_picture:
            on_picture(len(shown), len(times))
    folder.mkdir(parents=True, exist_ok=True)
    write_strip(shown, folder / STRIP)
    write_preview(shown, folder / PREVIEW)


def write_strip(shown: list[Picture], path: Path) -> None:
    """Of pictures (H, W, 3) over time AGES in a row, evenly up to the last; the very sprout is too small to see."""
    chosen = np.unique(np.round(np.linspace(0, len(shown) - 1, AGES + 1)[1:]).astype(int))
    write_png(path, np.hstack([shown[k] for k in chosen]))


def write_preview(shown: list[Picture], path: Path) -> None:
    """Pictures (H, W, 3) as an APNG that runs for ever; the last one stays a while."""
    from PIL import Image

    each = round(1000 * SECONDS / len(shown))
    duration = [each] * (len(shown) - 1) + [round(1000 * REST)]
    # One palette for all: a third of the bytes, and the background does not flicker.
    palette = Image.fromarray(np.vstack([one[::4, ::4] for one in shown])).quantize(256)
    images = [Image.fromarray(one).quantize(palette=palette, dither=Image.Dither.NONE) for one in shown]
    images[0].save(path, format="PNG", save_all=True, append_images=images[1:], duration=duration, loop=0)


def film_pictures(earlier: Path, folder: Path, href: str, name: str) -> tuple[PictureFile, ...]:
    """The film of a tree in its `earlier` report folder, taken over into `folder`; empty where there is none."""
    found = []
    for file, caption in ((PREVIEW, "Growth"), (STRIP, "Growth, from sprout to finished tree")):
        if not (earlier / file).is_file():
            continue
        if earlier != folder:
            folder.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(earlier / file, folder / file)
        picture = cv2.imdecode(np.frombuffer((folder / file).read_bytes(), np.uint8), cv2.IMREAD_COLOR)
        if picture is not None:
            size = (picture.shape[1], picture.shape[0])
            found.append(PictureFile(f"{href}/{file}", caption, f"{name}: {caption.lower()}", size))
    return tuple(found)
