"""Circle tracing: a circle moves along each stroke and into the forks it finds (Tan et al. 2008, sec. 2)."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.strategy import Strategy
from forestgen.tree.strokes import Strokes, draw_polyline, fill_outline
from forestgen.tree.trace.branch_colours import fit_branch_colours
from forestgen.tree.trace.drafting import Draft
from forestgen.tree.trace.polylines import resample
from forestgen.tree.trace.simplify import simplify

FULL_SIZE = 1500  # px of a photo's longer side for which the paper states its circle (sec. 2)
SHARPEST = np.cos(np.deg2rad(120.0))  # a branch turning by more runs back along itself; the paper is silent


@dataclass(frozen=True, eq=False)
class TraceModels:
    """What is prepared once for a photo, so that each stroke is traced at once."""

    is_branch: NDArray[np.bool_]  # (H, W) looks like wood
    is_near: NDArray[np.bool_]  # (H, W) where this tree may be: crown and strokes, one circle wider
    circle_px: float

    def __post_init__(self) -> None:
        freeze(self, is_branch=(np.bool_, "H", "W"), is_near=(np.bool_, "H", "W"))


@dataclass(frozen=True, kw_only=True)
class CircleTracing(Strategy):
    """Tan et al. 2008, sec. 2, "Visible branch tracing", with every printed value.

    The paper does not say where tracing ends sideways: bark-coloured ground would be followed
    for ever. Here a circle centre stays within one circle of the crown outline and the strokes.
    """

    n_branch: int = 5  # Gaussians of the branch model (sec. 2)
    n_other: int = 5  # Gaussians of the model of all other pixels (sec. 2)
    too_close: float = 0.5  # Bhattacharyya distance to a foliage component; the paper says "too close" only
    circle_px: float = 50.0  # radius at 1500 px, scaled with the photo's longer side (sec. 2)
    least_turn_deg: float = 30.0  # joints that turn less are dropped (sec. 2)
    spacing: float = 0.6  # of the circle: a centre nearer to the graph is traced already; the paper is silent

    def __call__(self, photo: Photo, strokes: Strokes, mattes: Mattes, *, rng: np.random.Generator) -> BranchGraph:
        models = self.prepare(photo, strokes, mattes, rng=rng)
        draft = Draft(strokes.root)
        for path in strokes.branches:
            trace_stroke(models, draft, path, self.spacing)
        graph = draft.finish(trunk_radius_px(models, strokes.branches[0]))
        return simplify(graph, np.deg2rad(self.least_turn_deg))

    def prepare(self, photo: Photo, strokes: Strokes, mattes: Mattes, *, rng: np.random.Generator) -> TraceModels:
        """Fit the appearance models and classify the photo: what does not change from stroke to stroke."""
        colours = fit_branch_colours(
            photo,
            strokes,
            mattes,
            n_branch=self.n_branch,
            n_other=self.n_other,
            too_close=self.too_close,
            rng=rng,
        )
        circle = self.circle_px * max(photo.size) / FULL_SIZE
        return TraceModels(colours.is_branch, near_tree(strokes, photo.size, circle), circle)


def near_tree(strokes: Strokes, size: tuple[int, int], margin_px: float) -> NDArray[np.bool_]:
    """Pixels (H, W) inside the crown outline or on a branch stroke, widened by a margin."""
    own = fill_outline(strokes.crown, size)
    for path in strokes.branches:
        own |= draw_polyline(path, size)
    return cv2.distanceTransform((~own).astype(np.uint8), cv2.DIST_L2, 5) <= margin_px


def trace_stroke(models: TraceModels, draft: Draft, path: NDArray[np.float64], spacing: float) -> None:
    """Add one stroke (K, 2) px and the branches that the circle finds beside it to the draft."""
    stations = resample(path, models.circle_px)
    node = draft.attach(stations[0], models.circle_px / 2)
    centres = deque([node])
    for point in stations[1:]:
        node = draft.add(point, node)
        centres.append(node)
    while centres:  # breadth first
        node = centres.popleft()
        centre = np.array(draft.xy[node])
        came = centre - np.array(draft.xy[draft.parent[node]]) if draft.parent[node] >= 0 else np.zeros(2)
        for point in clusters_on_circle(models.is_branch, centre, models.circle_px):
            goes = point - centre
            if goes @ came < SHARPEST * np.hypot(*goes) * np.hypot(*came):
                continue
            if draft.distance(point).min() < spacing * models.circle_px or not inside(models.is_near, point):
                continue
            if is_straight_line(models.is_branch, centre, point):
                centres.append(draft.add(point, node))


def circle_points(centre: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """Points (C, 2) px around a circle, one a pixel of its length."""
    angle = np.linspace(0, 2 * np.pi, max(8, int(np.ceil(2 * np.pi * radius))), endpoint=False)
    return np.asarray(centre + radius * np.column_stack([np.cos(angle), np.sin(angle)]))


def look_up(mask: NDArray[np.bool_], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Values (N,) of a mask (H, W) at points (N, 2) px; False outside."""
    column, row = np.floor(points).astype(np.int64).T
    within = (row >= 0) & (row < mask.shape[0]) & (column >= 0) & (column < mask.shape[1])
    found = np.zeros(len(points), bool)
    found[within] = mask[row[within], column[within]]
    return found


def inside(mask: NDArray[np.bool_], point: NDArray[np.float64]) -> bool:
    """Whether a point (2,) px lies on the mask."""
    return bool(look_up(mask, point[None])[0])


def clusters_on_circle(
    is_branch: NDArray[np.bool_], centre: NDArray[np.float64], radius: float
) -> list[NDArray[np.float64]]:
    """The middle points (2,) px of the runs of branch pixels on a circle; none where all or nothing is branch."""
    points = circle_points(centre, radius)
    hit = look_up(is_branch, points)
    if hit.all() or not hit.any():
        return []
    first = np.flatnonzero(hit & ~np.roll(hit, 1))
    last = np.flatnonzero(hit & ~np.roll(hit, -1))
    if last[0] < first[0]:  # the last run goes on past the end of the list
        last = np.append(last[1:], last[0] + len(hit))
    middle = (first + last) / 2 * (2 * np.pi / len(hit))
    return list(centre + radius * np.column_stack([np.cos(middle), np.sin(middle)]))


def is_straight_line(is_branch: NDArray[np.bool_], start: NDArray[np.float64], end: NDArray[np.float64]) -> bool:
    """Whether all pixels between two points (2,) px are branch; the start itself may lie off it."""
    n = max(2, int(np.ceil(np.hypot(*(end - start)))))
    share = np.arange(1, n)[:, None] / n
    return bool(look_up(is_branch, start + share * (end - start)).all())


def trunk_radius_px(models: TraceModels, trunk: NDArray[np.float64]) -> float:
    """Half the trunk's width, px: the largest circle, near the root, whose pixels are all branch.

    The circle is tried at places along the first four circle radii of the stroke, since at the
    root itself half of it lies on the ground. Where no circle fits, one pixel.
    """
    near = resample(trunk, models.circle_px / 5)[:20]
    for radius in range(int(np.ceil(2 * models.circle_px)), 1, -1):
        if any(look_up(models.is_branch, circle_points(centre, radius)).all() for centre in near):
            return float(radius)
    return 1.0
