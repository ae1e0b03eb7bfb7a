"""The figures of Neubert et al. 2007, from our own trees.

    python docs/make_neubert_pictures.py out/garden docs/neubert

Reads the built sample scene `garden` and writes figure_3.jpg (density), figure_4.jpg (direction fields and flows),
figure_5.jpg (skeletons of two seeds), figure_7.jpg (photos and trees) and figure_9.jpg (painted foliage).
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import stage_rng
from forestgen.check import pictures
from forestgen.reference import read_provenance, read_views
from forestgen.render import Studio, frame_camera
from forestgen.tree.da_vinci import DaVinci
from forestgen.tree.density_views import density_steps
from forestgen.tree.lift.direction_field import Blend, DirectionField
from forestgen.tree.lift.flow_in_plane import flow_in_plane
from forestgen.tree.lift.particle_flow import ParticleFlow
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View
from forestgen.usd.read import read_drawables

Picture = NDArray[np.uint8]
ROW = 420  # height of a row of pictures, px
INK, PAPER, GRAPH = (40, 44, 48), (247, 247, 244), (47, 109, 143)
TREE, PAINTED = "oak_summer", "oak_painted"
PLANE = np.array([[200.0, 400], [200, 290], [110, 190], [60, 80], [280, 170], [350, 90], [215, 150], [190, 60]])
PLANE_PARENT = np.array([-1, 0, 1, 2, 1, 4, 1, 6])  # figure 4's attractor graph: a trunk and three limbs


def in_rows(rows: Sequence[Sequence[Picture]]) -> Picture:
    """Rows of pictures, each ROW high, one below the other on paper."""
    strips = [np.hstack([_as_high(picture, ROW) for picture in row]) for row in rows]
    width = max(strip.shape[1] for strip in strips)
    wide = [cv2.copyMakeBorder(s, 0, 0, 0, width - s.shape[1], cv2.BORDER_CONSTANT, value=PAPER) for s in strips]
    return np.asarray(np.vstack(wide), np.uint8)


def _as_high(picture: Picture, height: int) -> Picture:
    size = (round(picture.shape[1] * height / picture.shape[0]), height)
    way = cv2.INTER_AREA if picture.shape[0] > height else cv2.INTER_NEAREST
    return np.asarray(cv2.resize(picture, size, interpolation=way), np.uint8)


def grey(density: NDArray[np.float64]) -> Picture:
    """Density (R, C) in [0, 1]: dark where there is much."""
    return np.repeat((255 * (1 - np.clip(density, 0, 1))).astype(np.uint8)[..., None], 3, axis=2)


def through(alpha: NDArray[np.float64], view: View) -> NDArray[np.float64]:
    """A volume (I, J, K) looked through from a view's side, the front's or the right's; its top row first."""
    is_front = abs(np.cos(view.camera.azimuth)) > 0.5
    seen = 1 - np.prod(1 - alpha, axis=2 if is_front else 0)
    return np.asarray(seen.T[::-1] if is_front else seen[::-1, ::-1])


def figure_3(views: Sequence[View]) -> Picture:
    """A view a row: its density, the first volume and the refined one seen from there, and its squares as drawn."""
    first, refined, squares = density_steps(views, resolution=25)
    rows = []
    for view, (seen, drawn) in zip(views, squares, strict=True):
        volumes = [through(volume.alpha, view) for volume in (first, refined)]
        rows.append([pictures.mattes_picture(view, pictures.frame_view(view)), *map(grey, (*volumes, seen, drawn))])
    return in_rows(rows)


def figure_4() -> Picture:
    """(a), (b) the linear and the constant field; (c) linear alone, (d) constant and (e) linear with attraction."""
    start = np.random.default_rng(4).uniform([20, 20], [380, 240], (220, 2))
    drawn: list[Picture] = []
    blends: tuple[Blend, Blend] = ("linear", "constant")
    for blend in blends:
        canvas = _sheet()
        _draw_field(canvas, flow_in_plane(PLANE, PLANE_PARENT, start, blend=blend, attraction=True)[0])
        drawn.append(_with_graph(canvas))
    for blend, attraction in ((blends[0], False), (blends[1], True), (blends[0], True)):
        canvas, (_, graph) = _sheet(), flow_in_plane(PLANE, PLANE_PARENT, start, blend=blend, attraction=attraction)
        _draw_ways(canvas, graph.position, graph.parent)
        drawn.append(_with_graph(canvas))
    return in_rows([drawn])


def _sheet() -> Picture:
    return np.full((840, 800, 3), PAPER, np.uint8)


def _with_graph(canvas: Picture) -> Picture:
    for node, above in enumerate(PLANE_PARENT):
        if above >= 0:
            ends = [np.round(2 * PLANE[k]).astype(int).tolist() for k in (node, above)]
            cv2.line(canvas, ends[0], ends[1], GRAPH, 5, cv2.LINE_AA)
    return canvas


def _draw_field(canvas: Picture, field: DirectionField) -> None:
    at = np.stack(np.meshgrid(np.arange(20, 400, 20), np.arange(20, 410, 20)), axis=-1).reshape(-1, 2).astype(float)
    vector = field.at(at)
    length = np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), 1e-9)
    for a, b in zip(2 * at, 2 * at + 26 * vector / length, strict=True):
        cv2.arrowedLine(
            canvas, a.round().astype(int).tolist(), b.round().astype(int).tolist(), INK, 1, cv2.LINE_AA, 0, 0.3
        )


def _draw_ways(canvas: Picture, position: NDArray[np.float64], parent: NDArray[np.int64]) -> None:
    xy = 2 * (position[:, :2] * [1, -1] + PLANE[0])
    carried = np.ones(len(parent), int)
    for node in range(len(parent) - 1, 0, -1):
        carried[parent[node]] += carried[node]
    for node in range(1, len(parent)):
        ends = [np.round(xy[k]).astype(int).tolist() for k in (node, parent[node])]
        cv2.line(canvas, ends[0], ends[1], INK, 1 + int(np.log10(carried[node])), cv2.LINE_AA)


def figure_5(views: Sequence[View], whole: Skeleton) -> Picture:
    """Two skeletons from other seeds, from the front, and the complete one of the scene from the front and the side."""
    frame, camera = pictures.frame_view(views[0]), views[0].camera
    side = replace(camera, azimuth=camera.azimuth + np.pi / 2)
    drawn = []
    for seed in (1, 2):
        skeleton = DaVinci()(ParticleFlow()(views, rng=stage_rng(seed, "lift")), views)
        drawn.append(pictures.skeleton_picture(skeleton, camera, frame))
    drawn += [pictures.skeleton_picture(whole, at, frame) for at in (camera, side)]
    return in_rows([drawn])


def portraits(tree: Path, azimuths_deg: Sequence[float]) -> list[Picture]:
    """The tree as written, lit, from several sides."""
    drawables = read_drawables(tree / f"{tree.name}.usda")
    with Studio(drawables) as studio:
        cameras = [
            frame_camera(drawables, azimuth=np.radians(azimuth), size=(ROW, ROW), margin=0.05)
            for azimuth in azimuths_deg
        ]
        return [pictures.portrait_picture(studio.lit(camera), foot=camera.root_px) for camera in cameras]


def photos(views: Sequence[View]) -> list[Picture]:
    return [pictures.photo_picture(view, pictures.frame_view(view)) for view in views]


def write_figures(figures: Mapping[int, Picture], folder: Path) -> None:
    """Write folder/figure_N.jpg for each number N."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, picture in figures.items():
        path = folder / f"figure_{number}.jpg"
        if not cv2.imwrite(str(path), picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88]):
            raise OSError(f"{path} could not be written")


def main(out: Path, folder: Path) -> None:
    """Write the figures."""
    tree, painted = out / "trees" / TREE, out / "trees" / PAINTED
    views, painted_views = read_views(tree / "reference"), read_views(painted / "reference")
    figures = {
        3: figure_3(views),
        4: figure_4(),
        5: figure_5(views, read_provenance(tree / "reference").skeleton),
        7: in_rows([photos(views), portraits(tree, [0, 90, 225])]),
        9: in_rows(
            [
                [*photos(painted_views), *(pictures.mattes_picture(v, pictures.frame_view(v)) for v in painted_views)],
                portraits(painted, [0, 90, 225]),
            ]
        ),
    }
    write_figures(figures, folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
