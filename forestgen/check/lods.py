"""Scores of a tree's levels of detail: each against the full tree, at the size from which it is drawn.

At such sizes the pixel grid would decide what is seen: a twig a third of a pixel thick is seen, but covers no
pixel by half, and whether two of them do together is chance. So both trees are drawn many times as large, FINE_PX
tall whatever the size, and the envelope is that of all they reach there, from one sample of a small pixel on;
it changes by less than 0.005 between 600 and 1200 px. Colours are first averaged over a true pixel's footprint.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.check import metrics
from forestgen.render import Drawable, Studio
from forestgen.render.drawable import extent_along

FINE_PX = 800  # height of the tree in the pictures compared
SEEN = 255 / 5  # alpha of a small pixel that one of its four samples reaches
SIDES = ((0.0, 0.0), (45.0, 0.0), (90.0, 0.0), (135.0, 0.0), (0.0, 30.0))  # azimuth and elevation, degrees
MARGIN = 0.03  # of the height around what is drawn
CARDS = "leaf_cards"  # foliage of this name is no leaf


@dataclass(frozen=True, eq=False)
class DrawnLevel:
    """One level of detail as things to draw."""

    level: str  # LOD0, LOD1, ...
    switch_px: float  # height of the tree on the screen from which down it is drawn; infinite for the full tree
    drawables: Sequence[Drawable]

    @property
    def n_triangles(self) -> int:
        return sum(drawable.n_triangles for drawable in self.drawables)

    @property
    def n_instances(self) -> int:
        """Leaves."""
        leaves = [d for d in self.drawables if d.is_leaf and CARDS not in d.name]
        return sum(len(d.transforms) for d in leaves)


@dataclass(frozen=True)
class LodScore:
    """What one level costs, and how it differs from the full tree: a row of report.json's `lods`."""

    level: str
    switch_px: float
    triangles: int
    instances: int
    envelope_iou: float  # mean over SIDES; at least 0.98 is wanted
    envelope_iou_worst: float
    colour_delta_e: float  # mean over SIDES; at most 2 is wanted


@dataclass(frozen=True, eq=False)
class _Seen:
    """The tree from one side."""

    rgba: NDArray[np.uint8]  # (H, W, 4) premultiplied
    envelope: metrics.Mask

    @property
    def mask(self) -> metrics.Mask:
        return np.asarray(self.rgba[..., 3] >= SEEN, np.bool_)


def score_levels(levels: Sequence[DrawnLevel]) -> list[LodScore]:
    """Score the levels after the first, which is the full tree. None where that shows nothing.

    Raises:
        RenderError: no OpenGL to render with.
    """
    full, *coarser = levels
    if not full.n_triangles or not coarser:
        return []
    cameras = _cameras(levels)
    truth = _look(full.drawables, cameras)
    return [_score(level, truth, _look(level.drawables, cameras)) for level in coarser]


def _score(level: DrawnLevel, truth: Sequence[_Seen], seen: Sequence[_Seen]) -> LodScore:
    footprint = FINE_PX / level.switch_px
    ious = [metrics.iou(a.envelope, b.envelope) for a, b in zip(truth, seen, strict=True)]
    shifts = [
        metrics.colour_delta_e(
            averaged(a.rgba, footprint), a.mask, averaged(b.rgba, footprint), b.mask, a.envelope, FINE_PX
        )
        for a, b in zip(truth, seen, strict=True)
    ]
    return LodScore(
        level=level.level,
        switch_px=float(level.switch_px),
        triangles=level.n_triangles,
        instances=level.n_instances,
        envelope_iou=float(np.mean(ious)),
        envelope_iou_worst=float(np.min(ious)),
        colour_delta_e=float(np.mean(shifts)),
    )


def averaged(rgba: NDArray[np.uint8], footprint: float) -> NDArray[np.float32]:
    """Colour (H, W, 3) in [0, 1] of a premultiplied picture (H, W, 4), averaged over `footprint` px squared."""
    side = max(1, round(footprint))
    mean = cv2.blur(rgba.astype(np.float32), (side, side), borderType=cv2.BORDER_CONSTANT)
    return np.asarray(np.clip(mean[..., :3] / np.maximum(mean[..., 3:], 1e-3), 0, 1), np.float32)


def _cameras(levels: Sequence[DrawnLevel]) -> list[Camera]:
    """Cameras that show all of every level, the full tree FINE_PX tall."""
    low, high = extent_along(levels[0].drawables, np.array([[0.0, 1.0, 0.0]]))[:, 0]
    px_per_metre = FINE_PX / max(float(high - low), 1e-6)
    cameras = []
    for azimuth, elevation in SIDES:
        turn = (math.radians(azimuth), math.radians(elevation))
        axes = Camera((1, 1), (0.0, 0.0), px_per_metre, *turn).axes[:2]
        extents = np.array([extent_along(level.drawables, axes) for level in levels if level.n_triangles])
        least, most = extents[:, 0].min(axis=0) * px_per_metre, extents[:, 1].max(axis=0) * px_per_metre
        room = MARGIN * FINE_PX
        width, height = np.ceil(most - least + 2 * room).astype(int).tolist()
        cameras.append(Camera((width, height), (float(room - least[0]), float(room + most[1])), px_per_metre, *turn))
    return cameras


def _look(drawables: Sequence[Drawable], cameras: Sequence[Camera]) -> list[_Seen]:
    """The drawables through each of the cameras."""
    seen = []
    with Studio(drawables) as studio:
        for camera in cameras:
            rgba = np.asarray(np.round(studio.colour(camera) * 255), np.uint8)
            seen.append(_Seen(rgba, metrics.envelope(rgba[..., 3] >= SEEN, FINE_PX)))
    return seen
