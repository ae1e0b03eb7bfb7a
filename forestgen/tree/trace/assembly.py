"""Assembly: smooth lines become a graph with few nodes, each as thick as the wood seen there."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.branches import BranchGraph
from forestgen.tree.trace.centre_lines import CentreLine, knots_of
from forestgen.tree.trace.half_width import at_points, falling_fit, raw_half_width, side_weights
from forestgen.tree.trace.wood_model import WoodModel

EXPONENT = 2.3  # of the pipe model, as in radius.MeasuredTaper
STRONGEST_TAPER = 0.04  # px a px: an oak's trunk thins by this much; crossing twigs merge into blobs that thin faster
LEAF_AWAY = 4.0  # px between a limb's edge and the next leaf: nearer, something may be hidden


def assemble(lines: list[CentreLine], model: WoodModel, *, off_px: float, longest_px: float) -> BranchGraph:
    """Nodes and radii of the lines: radii fall along each line, and no branch is thicker than its parent there."""
    feet: list[list[int]] = [[] for _ in lines]
    for line in lines[1:]:
        feet[line.parent].append(line.foot)
    xy, parent, radius = [], [], []
    node_of: list[dict[int, int]] = []
    fitted: list[NDArray[np.float64]] = []
    count = 0
    for index, line in enumerate(lines):
        most = np.inf if line.parent < 0 else float(fitted[line.parent][line.foot])
        half = line_radius(line, model, most)
        fitted.append(np.where(np.isnan(half), _carried(half, most), half))
        knots = knots_of(line, feet[index], off_px, longest_px)
        if line.parent >= 0:
            knots = knots[1:]  # the foot is the parent's node
        before = -1 if line.parent < 0 else node_of[line.parent][line.foot]
        names = {int(knot): count + i for i, knot in enumerate(knots)}
        if line.parent >= 0:
            names[0] = before
        node_of.append(names)
        parent += [before, *range(count, count + len(knots) - 1)]
        xy.append(line.xy[knots])
        radius.append(half[knots])
        count += len(knots)
    half = np.concatenate(radius)
    graph = BranchGraph(np.concatenate(xy), np.array(parent), half)
    return BranchGraph(graph.xy, graph.parent, np.minimum(half, carried_limit(graph, model.is_foliage)))


def line_radius(line: CentreLine, model: WoodModel, most: float) -> NDArray[np.float64]:
    """Half widths (K,) px along a line: falling, at most `most`, NaN where no wood is seen."""
    half = raw_half_width(model.distance, line.xy)
    seen = (half > 0) & ~line.is_hidden
    result = np.full(len(half), np.nan)
    if seen.any():
        weight = side_weights(line.xy, half, model.is_foliage)
        if line.parent < 0:  # at the foot the wood ends below, and its edge there is nearer than its sides
            weight[np.hypot(*(line.xy - line.xy[0]).T) < 1.5 * np.median(half[seen])] = 1e-3
        result[seen] = np.minimum(falling_fit(half[seen], weight[seen]), most)
        if line.parent < 0:
            first = int(np.argmax(seen))
            result[:first] = result[first]  # the root's own pixel may lie a little off the wood
    return result


def _carried(half: NDArray[np.float64], most: float) -> NDArray[np.float64]:
    """Half widths (K,) with the last known value, or `most`, where they are NaN."""
    known = np.where(np.isnan(half), 0, np.arange(1, len(half) + 1))
    last = np.maximum.accumulate(known)
    return np.where(last > 0, half[np.maximum(last - 1, 0)], most)


def carried_limit(graph: BranchGraph, is_foliage: NDArray[np.bool_]) -> NDArray[np.float64]:
    """The most that each node's half width (N,) px can be, where all that it carries is seen; else infinite.

    Where bare twigs cross in the photo their wood merges, and its half width is that of no branch.
    A limb is no thicker than its children together (r ** 2.3 adds up) and a strong taper allow.
    """
    to_leaf = cv2.distanceTransform((~is_foliage).astype(np.uint8), cv2.DIST_L2, 5) if is_foliage.any() else None
    known = ~np.isnan(graph.radius_px)
    half = np.where(known, graph.radius_px, 0)
    is_free = known if to_leaf is None else known & (at_points(to_leaf, graph.xy) > half + LEAF_AWAY)
    step = np.hypot(*(graph.xy - graph.xy[np.maximum(graph.parent, 0)]).T)
    carried = np.zeros(len(graph))
    limit = np.full(len(graph), np.inf)
    is_tip = np.bincount(graph.parent[1:], minlength=len(graph)) == 0
    for node in range(len(graph) - 1, -1, -1):
        if is_free[node]:
            limit[node] = half[node] if is_tip[node] else carried[node] ** (1 / EXPONENT)
        if node:
            own = min(limit[node], half[node]) if is_free[node] else np.inf
            carried[graph.parent[node]] += (own + STRONGEST_TAPER * step[node]) ** EXPONENT
    return limit
