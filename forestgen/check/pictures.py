"""Pictures of the report: what came in, what was found, what was drawn and how the two differ. All uint8 RGB."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.tree.skeleton import Skeleton, branch_order, height_above_tips, main_child
from forestgen.tree.view import View

Picture = NDArray[np.uint8]  # (H, W, 3) sRGB

LONGEST = 720  # px of a picture's longer side: a report of many trees stays small
MARGIN = 0.06  # room around the tree, share of its extent
PAPER, INK = (247, 247, 244), (44, 48, 52)
FOLIAGE, BRANCH = (96, 150, 72), (134, 88, 50)
CROWN, STROKE, BACKGROUND = (255, 214, 10), (255, 96, 64), (64, 156, 255)
BOTH, MISSING, TOO_MUCH = (176, 182, 180), (214, 66, 60), (38, 118, 200)
ORDERS = ((92, 58, 33), (178, 86, 29), (222, 140, 30), (118, 150, 44), (38, 140, 120), (48, 104, 170), (120, 80, 160))


@dataclass(frozen=True)
class Frame:
    """A window of a photo and the scale at which the report shows it."""

    left: int
    top: int
    width: int  # px of the photo
    height: int
    scale: float

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the picture, px."""
        return max(1, round(self.width * self.scale)), max(1, round(self.height * self.scale))

    def cut(self, image: NDArray[np.uint8]) -> Picture:
        """The window of an image (H, W, C), averaged down."""
        part = image[self.top : self.top + self.height, self.left : self.left + self.width]
        return np.asarray(cv2.resize(part, self.size, interpolation=cv2.INTER_AREA), np.uint8)

    def place(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where points (N, 2) of the photo fall in the picture, px."""
        return (xy - [self.left, self.top]) * self.scale


def frame_view(view: View) -> Frame:
    """The window that holds all strokes and the tree found, with a margin; shown at most 720 px long."""
    rows, columns = np.nonzero(view.mattes.is_tree)
    points = np.concatenate([view.strokes.crown, *view.strokes.branches])
    if len(rows):
        points = np.vstack([points, [columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]])
    room = MARGIN * np.ptp(points, axis=0).max()
    size = np.array(view.photo.size)
    left, top = np.clip(np.floor(points.min(axis=0) - room), 0, size - 1).astype(int)
    right, bottom = np.clip(np.ceil(points.max(axis=0) + room), [left + 1, top + 1], size).astype(int)
    scale = min(1.0, LONGEST / max(right - left, bottom - top))
    return Frame(int(left), int(top), int(right - left), int(bottom - top), scale)


def photo_picture(view: View, frame: Frame) -> Picture:
    """The photo itself."""
    return frame.cut(view.photo.rgb)


def strokes_picture(view: View, frame: Frame) -> Picture:
    """What the user drew, over the photo."""
    canvas = frame.cut(view.photo.rgb)
    _lines(canvas, [frame.place(np.vstack([view.strokes.crown, view.strokes.crown[:1]]))], CROWN, 3)
    _lines(canvas, [frame.place(path) for path in view.strokes.branches], STROKE, 3)
    _lines(canvas, [frame.place(path) for path in view.strokes.background], BACKGROUND, 3)
    for stroke in view.strokes.density:
        width = max(1, round(2 * stroke.radius_px * frame.scale))
        _lines(canvas, [frame.place(stroke.path)], FOLIAGE if stroke.add else BACKGROUND, width)
    return canvas


def mattes_picture(view: View, frame: Frame) -> Picture:
    """Foliage in green and branches in brown, on paper."""
    alpha = np.dstack([view.mattes.foliage, view.mattes.branch])
    foliage, branch = np.moveaxis(frame.cut(np.asarray(alpha * 255, np.uint8)).astype(float) / 255, 2, 0)
    canvas = np.full((*foliage.shape, 3), PAPER, float)
    for share, colour in ((branch, BRANCH), (foliage, FOLIAGE)):
        canvas += share[..., None] * (np.array(colour) - canvas)
    return np.asarray(canvas.round(), np.uint8)


def trace_picture(view: View, frame: Frame) -> Picture:
    """The branches found in the photo, coloured by order, over the faded photo."""
    photo = frame.cut(view.photo.rgb)
    canvas = np.asarray(photo * 0.45 + 255 * 0.55, np.uint8)
    graph = view.branches
    xyz = np.column_stack([graph.xy, np.zeros(len(graph))])
    _draw_tree(canvas, frame.place(graph.xy), graph.parent, graph.radius_px * frame.scale, xyz)
    return canvas


def skeleton_picture(skeleton: Skeleton, camera: Camera, frame: Frame) -> Picture:
    """The grown skeleton through a camera, coloured by branch order, on paper."""
    canvas = np.full((*frame.size[::-1], 3), PAPER, np.uint8)
    radius = skeleton.radius * camera.px_per_metre * frame.scale
    _draw_tree(canvas, frame.place(camera.project(skeleton.position)), skeleton.parent, radius, skeleton.position)
    return canvas


def render_picture(colour: NDArray[np.float32], is_tree: NDArray[np.bool_], frame: Frame) -> Picture:
    """The unlit render as it was measured, on the report's backdrop. Colour (H, W, 3) in [0, 1]."""
    solid = np.where(is_tree[..., None], colour * 255, PAPER)
    return frame.cut(np.asarray(solid.round(), np.uint8))


def difference_picture(reference: NDArray[np.bool_], render: NDArray[np.bool_], frame: Frame) -> Picture:
    """Grey where photo and render agree, red where the tree is missing, blue where there is too much."""
    canvas = np.full((*reference.shape, 3), PAPER, np.uint8)
    canvas[reference & render] = BOTH
    canvas[reference & ~render] = MISSING
    canvas[render & ~reference] = TOO_MUCH
    return frame.cut(canvas)


def portrait_picture(rgba: NDArray[np.float32], *, foot: tuple[float, float] | None = None) -> Picture:
    """A lit render (H, W, 4, premultiplied) before a soft backdrop, with a shadow on the ground at `foot` px."""
    height, width = rgba.shape[:2]
    down = np.linspace(0, 1, height)[:, None, None]
    backdrop = np.array([0.90, 0.92, 0.94]) * (1 - down) + np.array([0.80, 0.80, 0.79]) * down
    backdrop = np.repeat(backdrop, width, axis=1)
    if foot is not None:
        shade = np.zeros((height, width), np.float32)
        crown = max(8.0, 0.35 * np.count_nonzero((rgba[..., 3] > 0.5).any(axis=0)))
        centre = (round(foot[0]), round(foot[1]))
        cv2.ellipse(shade, centre, (int(crown), int(crown * 0.10) + 1), 0, 0, 360, (0.35,), -1)
        shade = np.asarray(cv2.GaussianBlur(shade, (0, 0), max(2.0, crown * 0.10)))
        backdrop = backdrop * (1 - shade[..., None])
    picture = rgba[..., :3] + (1 - rgba[..., 3:]) * backdrop
    return np.asarray((np.clip(picture, 0, 1) * 255).round(), np.uint8)


def _draw_tree(
    canvas: Picture,
    xy: NDArray[np.float64],
    parent: NDArray[np.int64],
    radius_px: NDArray[np.float64],
    position: NDArray[np.float64],
) -> None:
    """Draw the edges of a rooted graph, coloured by branch order, the trunk on top."""
    weight = height_above_tips(position, parent)
    order = branch_order(parent, main_child(weight, parent))
    width = np.clip(np.nan_to_num(2 * radius_px, nan=2.0).round(), 1, 24).astype(int)
    for rank in range(int(order.max()), -1, -1):
        colour = ORDERS[min(rank, len(ORDERS) - 1)]
        of_rank = np.flatnonzero((order == rank) & (parent >= 0))
        for thick in np.unique(width[of_rank]):
            nodes = of_rank[width[of_rank] == thick]
            _lines(canvas, list(np.stack([xy[parent[nodes]], xy[nodes]], axis=1)), colour, int(thick))


def _lines(canvas: Picture, paths: list[NDArray[np.float64]], colour: tuple[int, int, int], width: int) -> None:
    """Draw polylines (K, 2) px, smooth, to an eighth of a pixel."""
    fixed = [np.round((path - 0.5) * 8).astype(np.int32) for path in paths]
    cv2.polylines(canvas, fixed, False, colour, width, cv2.LINE_AA, 3)
