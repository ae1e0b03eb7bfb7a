"""The trunk in space: the line whose picture is the traced trunk in every view at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.tree.view import View

SPACING = 0.01  # of the height: from node to node
ROUNDS = 6  # of the fixed point; with parallel projection the first one is exact
UPRIGHT = 1e-3  # weight of no shift at all against a view's word: decides what no view sees, the depth of one photo


@dataclass(frozen=True, eq=False)
class Limbs:
    """Wood that the photos show, in space. N nodes; node 0 is the root at the origin."""

    position: NDArray[np.float64]  # (N, 3) m
    parent: NDArray[np.int64]  # (N,) parent[0] == -1, else parent[i] < i
    radius: NDArray[np.float64]  # (N,) m, NaN where it was not measured


def trunk_nodes(view: View) -> NDArray[np.int64]:
    """The nodes of a view's graph from the root to where the trunk stroke ends; the root alone without a graph."""
    graph = view.branches
    end = view.strokes.branches[0][-1]
    node = int(np.argmin(np.hypot(*(graph.xy - end).T)))
    way = [node]
    while graph.parent[way[-1]] >= 0:
        way.append(int(graph.parent[way[-1]]))
    return np.array(way[::-1])


def trunk_top(view: View) -> float:
    """Height in metres of the end of a view's trunk, seen as if it stood in the root's plane."""
    return float(view.camera.unproject(_trunk_line(view)[0])[:, 1].max())


def trunk_in_space(views: Sequence[View], top: float) -> Limbs:
    """The trunk up to the height `top`: at each height the place that all views' trunks ask for, by least squares."""
    height = np.linspace(0, top, max(2, round(1 / SPACING)))
    position = np.column_stack([np.zeros(len(height)), height, np.zeros(len(height))])
    lines = [_trunk_line(view) for view in views]
    right = np.array([view.camera.axes[0] for view in views])[:, [0, 2]]
    normal = right.T @ right + UPRIGHT * np.eye(2)
    for _ in range(ROUNDS):
        off = np.array([_sideways(v.camera, *line, position) for v, line in zip(views, lines, strict=True)])
        position[1:, [0, 2]] += np.linalg.solve(normal, right.T @ off[:, 1:]).T
    radius = np.array([_radius_along(v, *line, position) for v, line in zip(views, lines, strict=True)])
    known = np.isfinite(radius)
    mean = np.where(known, radius, 0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    return Limbs(position, np.arange(-1, len(height) - 1), np.where(known.any(axis=0), mean, np.nan))


def metres_of(radius_px: NDArray[np.float64], camera: Camera, position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Radii (N,) in metres of what appears as radius_px (N,) at position (N, 3): nearer things appear larger."""
    closer = camera.depth(position) / camera.distance if camera.focal_px is not None else 0.0
    return np.asarray(radius_px / camera.px_per_metre * (1 - closer))


def _trunk_line(view: View) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (K, 2) px of the trunk from the root up, and half widths (K,) px; the stroke itself without a graph."""
    nodes = trunk_nodes(view)
    if len(nodes) < 2:
        stroke = view.strokes.branches[0]
        return stroke, np.full(len(stroke), np.nan)
    return view.branches.xy[nodes], view.branches.radius_px[nodes]


def _along(
    camera: Camera, line: NDArray[np.float64], value: NDArray[np.float64], position: NDArray[np.float64]
) -> NDArray[np.float64]:
    """A value (K,) along a line (K, 2) px, at the rows in which positions (N, 3) appear; no line runs back down."""
    row = np.minimum.accumulate(line[:, 1])
    return np.asarray(np.interp(-camera.project(position)[:, 1], -row, value))


def _sideways(
    camera: Camera, line: NDArray[np.float64], _: NDArray[np.float64], position: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Metres (N,) by which positions (N, 3) should move to the photo's right to appear on a line (K, 2) px."""
    return metres_of(_along(camera, line, line[:, 0], position) - camera.project(position)[:, 0], camera, position)


def _radius_along(
    view: View, line: NDArray[np.float64], radius_px: NDArray[np.float64], position: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Measured radii (N,) m of the trunk at positions (N, 3); NaN next to where it was not measured."""
    return metres_of(_along(view.camera, line, radius_px, position), view.camera, position)


def densified(
    place: NDArray[np.float64], parent: NDArray[np.int64], radius: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """A graph with nodes at most `spacing` apart: places (M, D), parents (M,) and radii (M,) of one with N nodes.

    Radii between two known ones are interpolated; next to an unknown one they are unknown.
    """
    above = np.maximum(parent, 0)
    way = place - place[above]
    count = np.maximum(np.ceil(np.linalg.norm(way, axis=1) / spacing), 1).astype(np.int64)
    last = np.cumsum(count) - 1  # where each given node goes
    node = np.repeat(np.arange(len(count)), count)
    within = np.arange(len(node)) - (last - count)[node]
    share = within / count[node]
    radii = radius[above[node]] + share * (radius[node] - radius[above[node]])
    radii[last] = radius
    before = np.arange(len(node)) - 1
    before[last - count + 1] = np.where(parent >= 0, last[above], -1)
    return place[above[node]] + share[:, None] * way[node], before, radii
