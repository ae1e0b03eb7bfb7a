"""Make the README's picture from a built sample scene: `python docs/make_pictures.py out/street docs`.

Left: one photo with its strokes, and the tree that was built from it, from the front and the side.
Below: the scene's stage as written, through a perspective camera.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.reference import read_views
from forestgen.render import Studio, frame_camera
from forestgen.usd.read import read_drawables

Picture = NDArray[np.uint8]
WIDTH, HEIGHT = 1500, 405  # of the panorama, px
ROW = 430  # height of the upper row, px
LIT = 0.86, 0.90, 0.95  # sky at the horizon, sRGB


def over_sky(rgba: NDArray[np.float32], between: NDArray[np.float32] | None = None) -> Picture:
    """A premultiplied picture (H, W, 4) laid over another one, where it is given, and over a pale sky."""
    fade = np.linspace(0.72, 1.0, len(rgba), dtype=np.float32)[:, None, None]
    sky = np.array(LIT, np.float32) * fade + (1 - fade)
    if between is not None:
        sky = between[..., :3] + sky * (1 - between[..., 3:])
    return np.asarray(np.round(np.clip(rgba[..., :3] + sky * (1 - rgba[..., 3:]), 0, 1) * 255), np.uint8)


def strokes_over_photo(tree: Path) -> Picture:
    """The photo of a tree's first view with its strokes, ROW pixels high."""
    view = read_views(tree / "reference")[0]
    picture = view.photo.rgb.copy()
    width = max(2, view.photo.size[1] // 250)
    cv2.polylines(picture, [view.strokes.crown.round().astype(np.int32)], True, (235, 60, 50), width, cv2.LINE_AA)
    for path in view.strokes.branches:
        cv2.polylines(picture, [path.round().astype(np.int32)], False, (40, 90, 235), width, cv2.LINE_AA)
    return np.asarray(cv2.resize(picture, (round(ROW * view.photo.size[0] / view.photo.size[1]), ROW), interpolation=3))


def portraits(tree: Path) -> list[Picture]:
    """The tree as written, lit, from the front and from the side."""
    drawables = read_drawables(tree / f"{tree.name}.usda")
    with Studio(drawables) as studio:
        return [
            over_sky(studio.lit(frame_camera(drawables, azimuth=np.radians(azimuth), size=(400, ROW), margin=0.04)))
            for azimuth in (0, 90)
        ]


def panorama(stage: Path, middle: tuple[float, float], reach: float) -> Picture:
    """The whole stage from across the road: `middle` is (x, z) of what is looked at, `reach` metres are shown."""
    distance = 1.35 * reach
    per_metre = WIDTH / reach
    at = Camera((WIDTH, HEIGHT), (0.0, 0.0), per_metre, 0.0, np.radians(7))
    right, up, toward = at.axes @ np.array([middle[0], 5.5, middle[1]])
    shift = np.array([WIDTH / 2 - right * per_metre, 0.58 * HEIGHT + up * per_metre])
    camera = Camera(
        (WIDTH, HEIGHT), (shift[0], shift[1]), per_metre, 0.0, np.radians(7), (distance + toward) * per_metre
    )
    drawables = read_drawables(stage)
    with Studio(drawables) as studio:
        picture = studio.lit(camera)
    ground = next(drawable for drawable in drawables if "/ground/" in drawable.name)
    return over_sky(picture, whole_ground(picture, camera, ground.points))


def whole_ground(picture: NDArray[np.float32], camera: Camera, corners: NDArray[np.float64]) -> NDArray[np.float32]:
    """Ground (H, 1, 4), premultiplied, for all that the stage's with its corners (4, 3) leaves open.

    It has the mean colour of the nearest that is seen, and fades from the far edge to the horizon.
    """
    beyond = np.geomspace(1, 2000, 400) - 1  # m behind the far edge
    row = camera.project(np.column_stack([np.zeros((400, 2)), corners[:, 2].min() - beyond]))[:, 1]
    at = np.arange(len(picture)) + 0.5
    alpha = np.where(at > row.min(), np.interp(at, row[::-1], np.exp(-beyond / 60)[::-1]), 0)[:, None, None]
    near = picture[-25:].reshape(-1, 4)
    colour = near[near[:, 3] > 0.99].mean(axis=0)
    return np.asarray(colour * alpha, np.float32)


def main(out: Path, folder: Path, tree: str = "oak_summer") -> None:
    """Write folder/forestgen.jpg."""
    row = [strokes_over_photo(out / "trees" / tree), *portraits(out / "trees" / tree)]
    top = np.hstack(row)
    top = np.asarray(cv2.resize(top, (WIDTH, round(ROW * WIDTH / top.shape[1])), interpolation=cv2.INTER_AREA))
    picture = np.vstack([top, panorama(next(iter(sorted(out.glob("*.usda")))), (37.0, 6.0), 92.0)])
    folder.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(folder / "forestgen.jpg"), picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88]):
        raise OSError(f"{folder / 'forestgen.jpg'} could not be written")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
