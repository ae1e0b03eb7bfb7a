"""The pictures of one tree in the report: what came in, what came out, and the tree from all sides."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2

from forestgen.check import pictures
from forestgen.check.lod_sheet import lod_sheet
from forestgen.check.lods import DrawnLevel
from forestgen.check.report import PictureFile, ViewReport
from forestgen.check.score import ViewScore
from forestgen.reference import Provenance
from forestgen.render import Drawable, Studio, frame_camera
from forestgen.tree.view import View

PORTRAIT = (560, 640)  # px
QUALITY = 86  # of the JPEGs
SIDES = (
    ("front", 0, 0, "From the front"),
    ("side", 90, 0, "From the side"),
    ("back", 180, 0, "From the back"),
    ("above", 0, 90, "From above"),
)


@dataclass(frozen=True)
class Album:
    """A folder that takes pictures, and the path by which report.html knows it."""

    folder: Path
    href: str

    def add(self, name: str, picture: pictures.Picture, caption: str, alt: str) -> PictureFile:
        """Write a picture as JPEG.

        Raises:
            OSError: it could not be written.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        fine, data = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        if not fine:
            raise OSError(f"{self.folder / name}.jpg: could not be encoded")
        (self.folder / f"{name}.jpg").write_bytes(data.tobytes())
        return PictureFile(f"{self.href}/{name}.jpg", caption, alt, (picture.shape[1], picture.shape[0]))


def view_report(album: Album, key: str, view: View, score: ViewScore, provenance: Provenance) -> ViewReport:
    """One view's row and its pictures: first the photo beside the render, then how it came about."""
    frame, drawn, name = pictures.frame_view(view), score.drawn, provenance.name
    side = replace(view.camera, azimuth=view.camera.azimuth + math.pi / 2)
    skeleton = provenance.skeleton
    shown = (
        ("photo", pictures.photo_picture(view, frame), "Photo", f"Photo of {name}"),
        (
            "render",
            pictures.render_picture(drawn.colour, drawn.is_tree, frame),
            "Render from the photo's viewpoint, unlit",
            f"Unlit render of {name} from where its photo was taken",
        ),
        (
            "difference",
            pictures.difference_picture(view.mattes.is_tree, drawn.is_tree, frame),
            "Difference",
            f"Difference of {name}: red is missing, blue is too much",
        ),
        ("strokes", pictures.strokes_picture(view, frame), "Strokes", f"Strokes drawn over {name}"),
        ("mattes", pictures.mattes_picture(view, frame), "Mattes", f"Foliage and branches found in {name}"),
        ("trace", pictures.trace_picture(view, frame), "Traced branches", f"Visible branches of {name}"),
        (
            "skeleton",
            pictures.skeleton_picture(skeleton, view.camera, frame),
            "Skeleton, by branch order",
            f"Skeleton of {name}, coloured by branch order",
        ),
        (
            "side_skeleton",
            pictures.skeleton_picture(skeleton, side, frame),
            "Skeleton from the side",
            f"Skeleton of {name} from the side",
        ),
    )
    files = tuple(album.add(f"{key}_{what}", picture, caption, alt) for what, picture, caption, alt in shown)
    return ViewReport(score.photo, float(score.azimuth), score.is_bare, score.scores, score.failed, files)


def draw_sheet(album: Album, levels: Sequence[DrawnLevel], name: str) -> tuple[PictureFile, ...]:
    """The levels of detail side by side."""
    words = "Levels of detail: as large as each other, and where one gives way to the next"
    return (album.add("lods", lod_sheet(levels), words, f"Levels of detail of {name}"),)


def draw_portraits(album: Album, studio: Studio, drawables: Sequence[Drawable], name: str) -> tuple[PictureFile, ...]:
    """Lit pictures from the front, the side, the back and above; none where there is nothing to draw."""
    if not any(drawable.n_triangles for drawable in drawables):
        return ()
    shown = []
    for key, azimuth, elevation, words in SIDES:
        camera = frame_camera(
            drawables, azimuth=math.radians(azimuth), elevation=math.radians(elevation), size=PORTRAIT, margin=0.07
        )
        foot = None if elevation else camera.root_px
        picture = pictures.portrait_picture(studio.lit(camera), foot=foot)
        shown.append(album.add(key, picture, words, f"{name}, lit, {words.lower()}"))
    return tuple(shown)
