"""How thick wood can be that the photos do not show, where they would: before the sky."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View

UNSEEN_PX = 0.1  # radius of wood that leaves no trace in a photo: a millimetre or so
OVER = 0.12  # share of a segment's way that its middle or an edge must lie over what is no tree
PROBES = 8  # points of a segment that are looked up
BESIDE_PX = 2.0  # so near to the traced wood it may well be seen: the matte is narrower there
SHIFT = 4  # binary digits of a pixel that lines are drawn to


def unseen_radius(
    skeleton: Skeleton, views: Sequence[View], radius: NDArray[np.float64], most_px: float = UNSEEN_PX
) -> NDArray[np.float64]:
    """The greatest radius (N,), metres, of the segment to each node, `most_px` of a photo; inf where none bounds it.

    `radius` (N,) is what it would have, metres: wood at the rim of a gap among leaves must not stand out over
    the gap. On a bare tree all wood is a rim.
    """
    most = np.full(len(skeleton), np.inf)
    for view in views:
        over = share_over(skeleton, view, empty_part(view), np.zeros_like(radius) if view.mattes.is_bare else radius)
        bound = most_px / view.camera.px_per_metre
        most = np.where(over >= OVER, np.minimum(most, bound), most)
    return most


def empty_part(view: View) -> NDArray[np.bool_]:
    """Where (H, W) a photo shows neither the tree nor anything beside its traced wood."""
    graph = view.branches
    beside = np.zeros(view.mattes.foliage.shape, np.uint8)
    xy = np.round((graph.xy - 0.5) * 2**SHIFT).astype(np.int32)
    width = np.maximum(1, np.rint(2 * (np.nan_to_num(graph.radius_px) + BESIDE_PX))).astype(int)
    for node in range(1, len(xy)):
        start, end = xy[graph.parent[node]].tolist(), xy[node].tolist()
        cv2.line(beside, start, end, 1, int(width[node]), cv2.LINE_8, SHIFT)
    return np.asarray(~view.mattes.is_tree & (beside == 0))


def share_over(
    skeleton: Skeleton, view: View, part: NDArray[np.bool_], radius: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The share (N,) of the segment to each node that lies over a part (H, W) of the photo; 0 for the root.

    Of its middle and its two edges, `radius` (N,) metres off, the one that lies most over it.
    """
    end = view.camera.project(skeleton.position)
    start = end[np.maximum(skeleton.parent, 0)]
    way = end - start
    aside = np.column_stack([-way[:, 1], way[:, 0]]) / np.maximum(np.linalg.norm(way, axis=1), 1e-9)[:, None]
    aside *= (radius * view.camera.px_per_metre)[:, None]
    height, width = part.shape
    share = np.zeros((3, len(end)))
    for t in (np.arange(PROBES) + 0.5) / PROBES:
        for line, side in enumerate((-1, 0, 1)):
            column, row = np.floor(start + t * way + side * aside).astype(np.int64).T
            framed = (column >= 0) & (column < width) & (row >= 0) & (row < height)
            share[line] += framed & part[row.clip(0, height - 1), column.clip(0, width - 1)]
    share[:, 0] = 0
    return np.asarray(share.max(axis=0) / PROBES)
