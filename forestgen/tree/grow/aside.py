"""Aside: twigs that run over small gaps of the crown step aside, to where the photo shows foliage.

A photo shows the sky in those gaps, and no twig. What grows in space heeds gaps that it could
not leap over; the small ones between leaves it only meets in the picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow.crown_volume import CrownVolume
from forestgen.tree.skeleton import height_above_tips

PIECE = 0.004  # of the height: a segment over a gap is bent in pieces no longer than this
REACH = 0.008  # of the height: how far a twig steps aside
YOUNG = 0.15  # of the height: what bears longer branches is a limb, and stays
PROBES = 8  # places of a segment that are looked at
ROUNDS = 2  # after a step aside in one view the others are looked at again


def step_aside(
    position: NDArray[np.float64], parent: NDArray[np.int64], n_fixed: int, volume: CrownVolume
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Places and parents of a tree (N,) whose twigs keep to foliage in every view, where some is near.

    The first `n_fixed` nodes stay.
    """
    young = height_above_tips(position, parent) < YOUNG * volume.height
    young[:n_fixed] = False
    gaps, foliage = _gaps(volume), [_nearest_to(shown) for shown in volume.shown]
    position, parent, may_move = _divided(position, parent, young, volume, gaps)
    before = position.copy()
    for _ in range(ROUNDS):
        for camera, nearest, gap in zip(volume.cameras, foliage, gaps, strict=True):
            xy = camera.project(position)
            there, column, row = _in_frame(xy, gap.shape)
            moves = np.flatnonzero(may_move & there & gap[row, column])
            goal, away = nearest.of(row[moves], column[moves])
            near = away <= REACH * volume.height * camera.px_per_metre
            moves, goal = moves[near], goal[near]
            position[moves] = camera.unproject(goal, camera.depth(position[moves]))
    worse = _views_over_gaps(position, volume, gaps) > _views_over_gaps(before, volume, gaps)
    return np.where(worse[:, None], before, position), parent


def _views_over_gaps(
    position: NDArray[np.float64], volume: CrownVolume, gaps: Sequence[NDArray[np.bool_]]
) -> NDArray[np.int64]:
    """In how many views points (N, 3) lie over gaps, or out of the frame, (N,)."""
    count = np.zeros(len(position), np.int64)
    for camera, gap in zip(volume.cameras, gaps, strict=True):
        there, column, row = _in_frame(camera.project(position), gap.shape)
        count += ~there | gap[row, column]
    return count


def _gaps(volume: CrownVolume) -> list[NDArray[np.bool_]]:
    """Where (H, W) each view shows neither foliage nor wood."""
    return [~shown & ~wooden for shown, wooden in zip(volume.shown, volume.wooden, strict=True)]


def _divided(
    position: NDArray[np.float64],
    parent: NDArray[np.int64],
    young: NDArray[np.bool_],
    volume: CrownVolume,
    gaps: Sequence[NDArray[np.bool_]],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_]]:
    """The tree with more nodes on the young segments (N,) that run over gaps; and which of its nodes are young."""
    start = position[np.maximum(parent, 0)]
    way = position - start
    crosses = np.zeros(len(parent), bool)
    for camera, gap in zip(volume.cameras, gaps, strict=True):
        for t in (np.arange(PROBES) + 1) / PROBES:
            there, column, row = _in_frame(camera.project(start + t * way), gap.shape)
            crosses |= there & gap[row, column]
    length = np.linalg.norm(way, axis=1)
    pieces = np.where(crosses & young, np.maximum(1, np.ceil(length / (PIECE * volume.height))), 1).astype(np.int64)
    last = np.cumsum(pieces) - 1  # of the old nodes among the new
    old = np.repeat(np.arange(len(parent)), pieces)
    rank = np.arange(len(old)) - last[old] + pieces[old]  # 1 .. pieces
    place = start[old] + (rank / pieces[old])[:, None] * way[old]
    place[last] = position
    above = np.where(
        rank == 1, np.where(parent[old] < 0, -1, last[np.maximum(parent[old], 0)]), np.arange(len(old)) - 1
    )
    return place, above, young[old]


def _in_frame(
    xy: NDArray[np.float64], shape: tuple[int, ...]
) -> tuple[NDArray[np.bool_], NDArray[np.int64], NDArray[np.int64]]:
    """Which points (N, 2) px lie in a picture, and their columns and rows (N,), 0 outside."""
    column, row = np.floor(xy).astype(np.int64).T
    there = (column >= 0) & (row >= 0) & (column < shape[1]) & (row < shape[0])
    return there, np.where(there, column, 0), np.where(there, row, 0)


@dataclass(frozen=True, eq=False)
class _Nearest:
    """For every pixel (H, W) the mask's pixel that is nearest, and how far that is."""

    label: NDArray[np.int32]  # (H, W)
    middle: NDArray[np.float64]  # (labels, 2) xy px
    away: NDArray[np.float32]  # (H, W) px

    def of(self, row: NDArray[np.int64], column: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The middle (N, 2) xy of the pixel that is nearest to each pixel, and how far that is (N,), px."""
        return self.middle[self.label[row, column]], self.away[row, column].astype(np.float64)


def _nearest_to(mask: NDArray[np.bool_]) -> _Nearest:
    away, label = cv2.distanceTransformWithLabels(
        (~mask).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    rows, columns = np.nonzero(mask)
    middle = np.zeros((int(label.max()) + 1, 2))
    middle[label[rows, columns]] = np.column_stack([columns, rows]) + 0.5
    return _Nearest(np.asarray(label, np.int32), middle, np.asarray(away, np.float32))
