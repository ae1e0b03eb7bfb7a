"""Spread branches: each traced branch leans towards or away from the camera, as far from the others as it can."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from forestgen.errors import StageError
from forestgen.tree.branch_paths import BranchPaths, cut_into_paths
from forestgen.tree.branches import BranchGraph
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import Strategy
from forestgen.tree.view import View

SAMPLES = np.array([0.35, 0.7, 1.0])  # places along a branch at which distances are measured, shares of its length


@dataclass(frozen=True, kw_only=True)
class SpreadBranches(Strategy):
    """Greedy spreading of Okabe et al. 2005 as used by Tan et al. 2008, sec. 3.1.

    One branch after the other, parents and long branches first, takes the lean at which it is
    farthest from those already placed. Only depth is chosen: the projection stays what was traced.
    """

    most_views: ClassVar[int | None] = 1
    n_leans: int = 13  # leans tried, evenly from the farthest back to the farthest forward; the papers are silent
    greatest_lean_deg: float = 60.0  # out of the photo's plane: at most half of a branch is foreshortened away
    upward_share: float = 0.35  # depth that a branch gains where it runs along its parent; sideways counts 1
    longest: float = 1.15  # a leaning branch's length, at most, over that of the longest branch of its parent
    plainness: float = 0.1  # how much of the distance a lean must gain to be preferred over the photo's plane

    def __call__(self, views: Sequence[View], *, rng: np.random.Generator) -> Skeleton:
        if len(views) != 1:
            raise StageError(f"spread_branches lifts one photo of a tree and came {len(views)}: choose another 'lift'")
        (view,) = views
        graph, camera = view.branches, view.camera
        flat = (graph.xy - graph.xy[0]) * [1.0, -1.0] / camera.px_per_metre
        leans = np.deg2rad(np.linspace(-1, 1, self.n_leans) * self.greatest_lean_deg)
        depth = spread_depth(
            flat, graph, leans, upward=self.upward_share, longest=self.longest, plainness=self.plainness, rng=rng
        )
        return Skeleton(camera.unproject(graph.xy, depth), graph.parent, graph.radius_px / camera.px_per_metre)


def spread_depth(
    flat: NDArray[np.float64],
    graph: BranchGraph,
    leans: NDArray[np.float64],
    *,
    upward: float,
    longest: float,
    plainness: float,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Depths (N,) towards the camera, in the units of flat (N, 2), the traced places with y up.

    The trunk stays in the plane. A branch's depth grows with the way it makes sideways from its
    parent, and a share `upward` of the way along it: what turns up beside the trunk stays beside it.
    """
    scale = 0.02 * float(np.ptp(flat, axis=0).max())  # a direction is seen over a fiftieth of the tree
    paths = cut_into_paths(flat, graph.parent, max(scale, 1e-9))
    depth = np.zeros(len(flat))
    placed = [_samples(flat, depth, paths, 0)]
    boxes = [_box(flat[paths.nodes[0]])]
    limit = _longest_sibling(paths) * longest
    for branch in paths.order[1:]:
        nodes, base = paths.nodes[branch], paths.base[branch]
        gain = sideways_length(flat, nodes, base, paths.axis[branch], upward)
        tip, length = gain[-1], paths.length[branch]
        lengths = np.hypot(length, tip * np.tan(leans))
        allowed = lengths <= max(limit[branch], length)
        near = _placed_nearby(placed, boxes, _box(flat[nodes]), length)
        score = _distances(flat, depth[base], nodes, gain, leans, length, near)
        score -= plainness * score.max() * (lengths / length - 1)
        score += 1e-6 * score.max() * rng.random(len(leans))  # a tie between front and back is tossed for
        best = leans[np.flatnonzero(allowed)[np.argmax(score[allowed])]]
        depth[nodes] = depth[base] + np.tan(best) * gain
        placed.append(_samples(flat, depth, paths, branch))
        boxes.append(_box(flat[nodes]))
    return depth


def sideways_length(
    flat: NDArray[np.float64], nodes: NDArray[np.int64], base: int, axis: NDArray[np.float64], upward: float
) -> NDArray[np.float64]:
    """Way from the base to each node of a branch (K,), counting what runs along `axis` (2,) only in part."""
    step = np.diff(flat[np.concatenate([[base], nodes])], axis=0)
    along = step @ axis
    across = step @ np.array([-axis[1], axis[0]])
    return np.cumsum(np.hypot(across, upward * along))


def _samples(
    flat: NDArray[np.float64], depth: NDArray[np.float64], paths: BranchPaths, branch: int
) -> NDArray[np.float64]:
    """Points (S, 3) along a placed branch; the trunk gets as many as it has nodes."""
    nodes = paths.nodes[branch]
    pick = nodes if branch == 0 else nodes[np.ceil(SAMPLES * len(nodes)).astype(int) - 1]
    return np.column_stack([flat[pick], depth[pick]])


def _box(flat: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([flat.min(axis=0), flat.max(axis=0)])


def _placed_nearby(
    placed: list[NDArray[np.float64]], boxes: list[NDArray[np.float64]], box: NDArray[np.float64], margin: float
) -> NDArray[np.float64]:
    """Points (M, 3) of the trunk and of all placed branches that come near in the photo."""
    corners = np.array(boxes)
    apart = (corners[:, :2] > box[2:] + margin) | (corners[:, 2:] < box[:2] - margin)
    near = np.union1d([0], np.flatnonzero(~apart.any(axis=1)))
    return np.concatenate([placed[other] for other in near])


def _distances(
    flat: NDArray[np.float64],
    start: float,
    nodes: NDArray[np.int64],
    gain: NDArray[np.float64],
    leans: NDArray[np.float64],
    length: float,
    others: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Mean distance (A,) of a branch at each lean from its nearest neighbours.

    The leaning branch is shrunk back to its length in the photo: otherwise the longest, which is
    always the steepest lean, would win for being long.
    """
    pick = np.ceil(SAMPLES * len(nodes)).astype(int) - 1
    tangent = np.tan(leans)[:, None]
    local = np.broadcast_to(flat[nodes[pick]], (len(leans), len(pick), 2))
    points = np.concatenate([local, (start + tangent * gain[pick])[..., None]], axis=-1)
    foot = np.append(flat[nodes[0]], start)
    shrink = length / np.hypot(length, tangent * gain[-1])
    points = foot + (points - foot) * shrink[..., None]
    apart = np.linalg.norm(points[:, :, None] - others, axis=-1)
    return np.asarray(apart.min(axis=2).mean(axis=1))


def _longest_sibling(paths: BranchPaths) -> NDArray[np.float64]:
    """For each branch, the length of the longest branch that leaves the same parent branch (B,)."""
    most = np.zeros(len(paths.parent))
    np.maximum.at(most, paths.parent[1:], paths.length[1:])
    return np.asarray(np.concatenate([[paths.length[0]], most[paths.parent[1:]]]))
