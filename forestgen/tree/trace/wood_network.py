"""Wood network: the medial lines of visible wood, cut at their junctions into pieces."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class WoodNetwork:
    """P pieces between J junctions. A piece is a run of neighbouring pixels without a fork."""

    points: tuple[NDArray[np.float64], ...]  # of each piece, (K, 2) px, in order
    ends: NDArray[np.int64]  # (P, 2) junction at the first and at the last point, -1 where the piece ends free
    component: NDArray[np.int64]  # (P,) connected part of the network
    pieces_at: tuple[tuple[tuple[int, int], ...], ...]  # per junction: (piece, which of its ends)
    length: NDArray[np.float64]  # (P,) px

    def __len__(self) -> int:
        return len(self.points)


def wood_network(wood: NDArray[np.bool_], distance: NDArray[np.float32], foot: NDArray[np.bool_]) -> WoodNetwork:
    """The network of a mask of wood (H, W); `distance` is each pixel's distance to the mask's edge.

    Spurs, free pieces that do not reach beyond the width of the wood they stand on, are dropped:
    thinning makes them at every unevenness of a limb's edge. The medial line of a trunk forks into
    the corners of its foot, so that pixels of `foot` (H, W) are left out.
    """
    from skimage.morphology import skeletonize  # its import is felt; it thins five times faster than OpenCV

    row, column = np.flatnonzero(wood.any(axis=1)), np.flatnonzero(wood.any(axis=0))
    if not len(row):
        return cut_at_junctions(wood)
    tight = np.s_[max(row[0] - 1, 0) : row[-1] + 2, max(column[0] - 1, 0) : column[-1] + 2]  # thinning costs by area
    thin = np.zeros(wood.shape, bool)
    thin[tight] = skeletonize(np.array(wood[tight]))  # type: ignore[no-untyped-call]
    thin &= ~foot
    for _ in range(2):  # a spur may stand on a spur
        network = cut_at_junctions(thin)
        spurs = [piece for piece in range(len(network)) if _is_spur(network, piece, distance)]
        if not spurs:
            break
        pixels = np.concatenate([network.points[piece] for piece in spurs]).astype(int)
        thin[pixels[:, 1], pixels[:, 0]] = False
    else:
        network = cut_at_junctions(thin)
    return network


def _is_spur(network: WoodNetwork, piece: int, distance: NDArray[np.float32]) -> bool:
    """Whether one end is free and the other stands on wood wider than the piece is long."""
    free = network.ends[piece] < 0
    if free.all() or not free.any():
        return False
    foot = network.points[piece][0 if free[1] else -1].astype(int)
    return bool(network.length[piece] < 1.5 * distance[foot[1], foot[0]] + 2)  # a corner of a limb's end is 1.4 off


def cut_at_junctions(thin: NDArray[np.bool_]) -> WoodNetwork:
    """Cut a thinned mask (H, W) into pieces at every pixel with more than two neighbours."""
    count = cv2.filter2D(thin.astype(np.uint8), cv2.CV_16S, np.ones((3, 3)), borderType=cv2.BORDER_CONSTANT) - 1
    is_junction = thin & (count >= 3)
    n_junctions, junction = cv2.connectedComponents(is_junction.astype(np.uint8))
    _, component = cv2.connectedComponents(thin.astype(np.uint8))
    _, piece = cv2.connectedComponents((thin & ~is_junction).astype(np.uint8))
    row, column = np.nonzero(piece)
    order = np.argsort(piece[row, column], kind="stable")
    row, column = row[order], column[order]
    label = piece[row, column]
    bounds = np.flatnonzero(np.diff(label)) + 1
    padded = np.pad(np.asarray(junction, np.int32), 1)
    points, ends, parts = [], [], []
    for rows, columns in zip(np.split(row, bounds), np.split(column, bounds), strict=True):
        if not len(rows):
            continue
        path = _in_order(columns.tolist(), rows.tolist())
        points.append(np.array(path, float) + 0.5)
        ends.append(_end_junctions(path, padded))
        parts.append(component[rows[0], columns[0]])
    pieces_at: list[list[tuple[int, int]]] = [[] for _ in range(n_junctions - 1)]
    for index, pair in enumerate(ends):
        for side, at in enumerate(pair):
            if at >= 0:
                pieces_at[at].append((index, side))
    steps = [float(np.hypot(*np.diff(path, axis=0).T).sum()) + 1 for path in points]
    return WoodNetwork(
        points=tuple(points),
        ends=np.array(ends, np.int64).reshape(-1, 2),
        component=np.array(parts, np.int64),
        pieces_at=tuple(tuple(at) for at in pieces_at),
        length=np.array(steps, float),
    )


def _in_order(x: list[int], y: list[int]) -> list[tuple[int, int]]:
    """The pixels of one piece walked from end to end; a ring is walked from its first pixel."""
    left = dict.fromkeys(zip(x, y, strict=True))
    sides = ((1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1))  # edge neighbours first
    start = next((p for p in left if sum((p[0] + i, p[1] + j) in left for i, j in sides) <= 1), next(iter(left)))
    path, here = [start], start
    del left[start]
    while left:
        for i, j in sides:
            if (here[0] + i, here[1] + j) in left:
                here = (here[0] + i, here[1] + j)
                break
        else:
            break
        del left[here]
        path.append(here)
    return path


def _end_junctions(path: list[tuple[int, int]], padded: NDArray[np.integer]) -> tuple[int, int]:
    """Junctions beside the first and the last pixel of a piece, -1 where there is none."""
    (x0, y0), (x1, y1) = path[0], path[-1]
    first = sorted(set(padded[y0 : y0 + 3, x0 : x0 + 3].ravel().tolist()) - {0})
    last = sorted(set(padded[y1 : y1 + 3, x1 : x1 + 3].ravel().tolist()) - {0})
    if len(path) == 1:  # one pixel between two junctions
        return (first[0] - 1 if first else -1, first[1] - 1 if len(first) > 1 else -1)
    return (first[0] - 1 if first else -1, last[0] - 1 if last else -1)
