"""Centre lines: a tree of pixels becomes smooth branches with few nodes that leave their parents naturally."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from forestgen.tree.branch_paths import cut_into_paths


@dataclass(frozen=True, eq=False)
class CentreLine:
    """One branch: K points from its foot on the parent branch to its tip."""

    xy: NDArray[np.float64]  # (K, 2) px
    is_hidden: NDArray[np.bool_]  # (K,) the wood is not seen here
    parent: int  # index of the parent line, -1 for the trunk
    foot: int  # index of the point of the parent line where it leaves


def without_twiglets(
    xy: NDArray[np.float64], parent: NDArray[np.int64], width: NDArray[np.float64], least_px: float
) -> NDArray[np.int64]:
    """Indices of the nodes to keep when side branches that hardly leave their parent are dropped.

    A branch goes when it does not stand out by `least_px` beyond the half width (N,) of its
    parent, or by less than it is wide itself: bumps of a ragged matte are blunt, twigs are not.
    """
    paths = cut_into_paths(xy, parent, 12.0)
    carries = np.zeros(len(paths), bool)  # a branch that stays keeps those that it stands on
    keep = np.ones(len(xy), bool)
    for branch in paths.order[::-1]:
        if branch == 0:
            continue
        base, nodes = int(paths.base[branch]), paths.nodes[branch]
        beside = paths.nodes[paths.parent[branch]]
        at = int(np.searchsorted(beside, base))
        window = int(paths.length[branch] + 3 * width[base]) + 3
        beside = beside[max(0, at - window) : at + window]
        some = nodes[:: -max(1, len(nodes) // 8)]
        apart = (np.hypot(*np.moveaxis(xy[some][:, None] - xy[beside], 2, 0)) - width[beside]).min(axis=1)
        blunt = 2 * np.median(width[some[apart > 0]]) if (apart > 0).any() else 0.0
        if apart.max() < max(least_px, blunt) and not carries[branch]:
            keep[nodes] = False
        else:
            carries[paths.parent[branch]] = True
    return np.flatnonzero(keep)


def centre_lines(
    xy: NDArray[np.float64],
    parent: NDArray[np.int64],
    width: NDArray[np.float64],
    is_hidden: NDArray[np.bool_],
    trust: NDArray[np.float64],
    smooth_px: float,
) -> list[CentreLine]:
    """Smooth branches, parents first, of a tree of pixels with nodes at xy (N, 2) and half widths (N,).

    `trust` (N,) says how much a node's place counts: leaves that cover a limb's side push its
    medial line aside.

    Within the width of its parent a branch's medial line is an accident of thinning; it is
    replaced by the straight continuation of the branch back to the parent's own line.
    """
    paths = cut_into_paths(xy, parent, 12.0)
    lines: list[CentreLine] = []
    index = np.full(len(paths), -1)  # of each branch's line
    within = np.zeros(len(xy), np.int64)  # of each node in its line
    for branch in paths.order:
        nodes, base = paths.nodes[branch], int(paths.base[branch])
        above, foot = (-1, 0) if branch == 0 else (int(index[paths.parent[branch]]), int(within[base]))
        if branch:
            outside = np.hypot(*(xy[nodes] - xy[base]).T) > 1.1 * width[base]
            first = min(int(np.argmax(outside)) if outside.any() else len(nodes) - 1, len(nodes) - 1)
            nodes = nodes[first:]
            foot = _natural_foot(lines[above].xy, foot, xy[nodes], width[base])
        start = np.empty((0, 2)) if branch == 0 else lines[above].xy[[foot]]
        points = fill_gaps(np.concatenate([start, xy[nodes]]))
        hidden = np.append(np.zeros(len(points) - len(nodes), bool), is_hidden[nodes])
        weight = np.append(np.ones(len(points) - len(nodes)), trust[nodes])
        sigma = np.clip(float(np.median(width[nodes])), smooth_px, 5 * smooth_px)
        index[branch] = len(lines)
        within[paths.nodes[branch]] = np.maximum(len(points) - len(nodes) - len(paths.nodes[branch]) + len(nodes), 0)
        within[nodes] = np.arange(len(points) - len(nodes), len(points))
        line = straight_tip(smooth_line(points, weight, float(sigma)), int(1.5 * width[nodes[-1]]) + 3)
        lines.append(CentreLine(line, hidden, above, foot))
    return lines


def fill_gaps(points: NDArray[np.float64], step: float = 1.5) -> NDArray[np.float64]:
    """A polyline (K, 2) whose first gap, from the foot to the branch, holds points about `step` px apart."""
    if len(points) < 2:
        return points
    n = int(np.hypot(*(points[1] - points[0])) / step)
    between = points[0] + np.arange(1, n)[:, None] / max(n, 1) * (points[1] - points[0])
    return np.concatenate([points[:1], between, points[1:]])


def _natural_foot(line: NDArray[np.float64], foot: int, branch: NDArray[np.float64], width: float) -> int:
    """The point of the parent's line from which the branch goes on straightest, near where thinning put it."""
    window = np.arange(max(0, foot - int(1.5 * width) - 2), min(len(line), foot + int(width) + 1))
    window = window if len(window) else np.array([min(foot, len(line) - 1)])
    ahead = branch[min(int(2 * width) + 6, len(branch) - 1)] - branch[0]
    toward = branch[0] - line[window]
    straight = (toward @ ahead) / np.maximum(np.hypot(*toward.T) * max(np.hypot(*ahead), 1e-9), 1e-9)
    return int(window[np.argmax(straight)])


def smooth_line(points: NDArray[np.float64], weight: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """A polyline (K, 2), a point a pixel, smoothed with a Gaussian of sigma px and weights (K,); both ends stay."""
    if len(points) < 3:
        return points
    pad = min(len(points) - 1, int(4 * sigma))
    front = 2 * points[0] - points[pad:0:-1]
    back = 2 * points[-1] - points[-2 : -pad - 2 : -1]
    padded = np.pad(weight, pad, mode="reflect")[:, None]
    total = gaussian_filter1d(padded, sigma, axis=0)
    smooth = gaussian_filter1d(np.concatenate([front, points, back]) * padded, sigma, axis=0) / total
    smooth = smooth[pad : pad + len(points)]
    smooth[0], smooth[-1] = points[0], points[-1]
    return np.asarray(smooth)


def straight_tip(line: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    """A line (K, 2) whose last n points go straight on: thinning bends a limb's end into a corner."""
    if len(line) < 4 * n:
        return line
    step = (line[-n - 1] - line[-3 * n]) / (2 * n - 1)
    tail = line[-n - 1] + np.arange(1, n + 1)[:, None] * step
    return np.concatenate([line[:-n], tail])


def knots_of(line: CentreLine, feet: list[int], off_px: float, longest_px: float) -> NDArray[np.int64]:
    """Indices of the points of a line that become nodes: the ends, the feet of its branches, and
    as many as keep the polyline within `off_px` of the line and its edges below `longest_px`."""
    keep = sorted({0, len(line.xy) - 1, *feet})
    stack = list(pairwise(keep))
    knots = set(keep)
    while stack:
        a, b = stack.pop()
        if b - a < 2:
            continue
        along = line.xy[b] - line.xy[a]
        size = float(np.hypot(*along))
        offset = line.xy[a + 1 : b] - line.xy[a]
        away = np.abs(offset[:, 0] * along[1] - offset[:, 1] * along[0]) / max(size, 1e-9)
        if away.max() > off_px:
            middle = a + 1 + int(np.argmax(away))
        elif size > longest_px:
            middle = (a + b) // 2
        else:
            continue
        knots.add(middle)
        stack += [(a, middle), (middle, b)]
    return np.array(sorted(knots))
