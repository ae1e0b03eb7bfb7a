"""Visible limbs in space: each traced branch gets the depth at which the other views show wood, or leaves, too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.tree.branch_paths import cut_into_paths
from forestgen.tree.branches import BranchGraph
from forestgen.tree.density import DensityVolume
from forestgen.tree.lift.direction_field import graph_points
from forestgen.tree.lift.flow_trunk import Limbs, densified, metres_of, trunk_in_space, trunk_nodes, trunk_top
from forestgen.tree.skeleton import branch_order, height_above_tips, main_child
from forestgen.tree.view import View

LEANS = np.deg2rad(np.linspace(-60, 60, 17))  # out of the photo's plane
BENDS = np.array([-0.5, 0.0, 0.5])  # share of the lean that is gained late (or, negative, early)
FINE_LEANS, FINE_BENDS = np.deg2rad([-5.0, -2.5, 0.0, 2.5, 5.0]), np.array([-0.25, 0.0, 0.25])
STEP = 0.012  # of the height: from node to node of a limb
SHORTEST = 0.02  # of the height: shorter branches are left to the flow
NEAR = 0.02  # of the height: lines so near to each other in a photo are one branch
ALIKE = 0.85  # least cosine between such lines
EXPLAINED = 0.6  # share of a branch that is near to lines of others
LOOSE = 0.03  # of the height: by how much photos that were arranged by hand may disagree
APART = 0.12  # of the height: limbs farther from each other than that do not crowd
SCALE = 0.05  # of the height: over what a traced branch's direction is taken
LINE_PX = 3.0  # from place to place along what was traced
FULL, LIKELY, SEEN, SPREAD, LEAN = 1.0, 0.5, 1.0, 0.5, 0.15  # what counts in choosing a depth, as `choose_depth` adds
EASING = 15  # rounds in which depths along a limb are evened out
BASES = 6  # places, from front to back, that a branch may leave from where its parent's is not known
INSIDE = 0.3  # of a branch must lie where no view is empty, or it is left to the flow
TAKEN = 0.6  # what a place in another view counts that some limb lies upon already
CHANCE = 0.04  # spread of the choice by the seed


@dataclass(frozen=True, eq=False)
class _Path:
    """A branch of one view, from where it leaves its parent."""

    view: int
    base: int  # node of the view's graph
    nodes: NDArray[np.int64]
    generation: int
    length: float  # m


@dataclass(frozen=True, eq=False)
class _Lines:
    """Places along a view's branches, without its trunk. P places."""

    tree: cKDTree
    tangent: NDArray[np.float64]  # (P, 2) unit, towards the root
    is_taken: NDArray[np.bool_]  # (P,) whether a limb in space lies upon it already; changed as limbs are placed


@dataclass(frozen=True, eq=False)
class _Evidence:
    """What says where a branch lies in depth."""

    views: Sequence[View]
    hull: DensityVolume  # filled where no view is empty
    density: DensityVolume  # filled where the crown is taken to be
    height: float  # m, of the tree
    lines: Sequence[_Lines | None]  # of each view, None where it shows the trunk alone

    def take(self, position: NDArray[np.float64]) -> None:
        """Note what a limb at position (K, 3), now in space, lies upon in each view."""
        for view, lines in zip(self.views, self.lines, strict=True):
            if lines is not None:
                near = NEAR * self.height * view.camera.px_per_metre
                for places in lines.tree.query_ball_point(view.camera.project(position), near):
                    lines.is_taken[places] = True


def limbs_in_space(
    views: Sequence[View], hull: DensityVolume, density: DensityVolume, *, rng: np.random.Generator
) -> Limbs:
    """The trunk and all branches that any view shows, in space: the longest of each generation first.

    `hull` is filled wherever no view is empty, `density` where the crown is taken to be. In the view
    that shows it a branch appears where it was traced. A branch that another view's branch, already
    in space, lies upon is the same one and is left out.
    """
    height = float(density.edge * density.alpha.shape[1])
    views = [_closely_traced(view, STEP * height) for view in views]
    top = min(trunk_top(view) for view in views)
    placed = _Placed(trunk_in_space(views, top), len(views))
    evidence = _Evidence(views, hull, density, height, [_lines_of(view, top) for view in views])
    paths: list[_Path] = []
    for index, view in enumerate(views):
        placed.name_trunk(index, view, _trunk_below(view, top))
        paths += [path for path in _paths_of(view, index, top) if path.length >= SHORTEST * height]
    for path in sorted(paths, key=lambda path: (path.generation, -path.length, path.view)):
        view = views[path.view]
        same = placed.explains(path, view, NEAR * height)
        if same is not None:
            placed.names[path.view][path.nodes] = same
            continue
        xy = view.branches.xy[path.nodes]
        base, depth, inside = choose_depth(
            path.view, xy, placed.bases_of(path, view, NEAR * height), placed.position, evidence, rng=rng
        )
        if inside >= INSIDE:
            position = view.camera.unproject(xy, depth)
            placed.append(path, base, position, metres_of(view.branches.radius_px[path.nodes], view.camera, position))
            evidence.take(position)
    return placed.eased(views)


def _closely_traced(view: View, spacing: float) -> View:
    """The view with nodes at most `spacing` metres apart along what was traced."""
    graph = view.branches
    spacing_px = spacing * view.camera.px_per_metre
    return replace(view, branches=BranchGraph(*densified(graph.xy, graph.parent, graph.radius_px, spacing_px)))


def _trunk_below(view: View, top: float) -> NDArray[np.int64]:
    """Nodes of a view's trunk up to the height `top`, metres."""
    trunk = trunk_nodes(view)
    return trunk[view.camera.unproject(view.branches.xy[trunk])[:, 1] <= top * (1 + 1e-9)]


def _lines_of(view: View, top: float) -> _Lines | None:
    place, tangent, node = graph_points(view.branches.xy, view.branches.parent, LINE_PX)
    is_branch = ~np.isin(node, _trunk_below(view, top))
    if not is_branch.any():
        return None
    return _Lines(cKDTree(place[is_branch]), tangent[is_branch], np.zeros(int(is_branch.sum()), bool))


def _paths_of(view: View, index: int, top: float) -> list[_Path]:
    """Branches of a view without its trunk up to the height `top`."""
    graph = view.branches
    is_trunk = np.zeros(len(graph), bool)
    is_trunk[_trunk_below(view, top)] = True
    flat = graph.xy / view.camera.px_per_metre
    order = branch_order(graph.parent, main_child(height_above_tips(flat, graph.parent), graph.parent))
    found = []
    for nodes in cut_into_paths(flat, graph.parent, SCALE * float(np.ptp(flat[:, 1])) + 1e-9).nodes:
        nodes = nodes[~is_trunk[nodes]]
        if len(nodes):
            base = int(graph.parent[nodes[0]])
            way = flat[np.concatenate([[base], nodes])]
            length = float(np.hypot(*np.diff(way, axis=0).T).sum())
            found.append(_Path(index, base, nodes, int(order[nodes[0]]), length))
    return found


class _Placed:
    """The limbs that are in space so far, and which of their nodes each view's nodes are."""

    def __init__(self, trunk: Limbs, n_views: int) -> None:
        self.position, self.parent, self.radius = trunk.position, trunk.parent, trunk.radius
        self.view = np.full(len(trunk.position), -1)  # whose branch a node is; -1 the trunk's
        self.names: list[NDArray[np.int64]] = [np.zeros(0, np.int64)] * n_views

    def name_trunk(self, index: int, view: View, on_trunk: NDArray[np.int64]) -> None:
        self.names[index] = np.full(len(view.branches), -1)
        _, nearest = cKDTree(view.camera.project(self.position)).query(view.branches.xy[on_trunk])
        self.names[index][on_trunk] = nearest

    def bases_of(self, path: _Path, view: View, near: float) -> NDArray[np.int64]:
        """Nodes in space that a branch may leave from: its parent's, or else those that appear nearest to its base."""
        known = int(self.names[path.view][path.base])
        if known >= 0 and self.view[known] in (-1, path.view):
            return np.array([known])
        gap = np.hypot(*(view.camera.project(self.position) - view.branches.xy[path.base]).T)
        close = np.flatnonzero(gap < max(near * view.camera.px_per_metre, float(gap.min()) + 1e-9))
        close = close[np.argsort(view.camera.depth(self.position[close]), kind="stable")]
        return close[np.unique(np.linspace(0, len(close) - 1, BASES).round().astype(np.int64))]

    def explains(self, path: _Path, view: View, near: float) -> NDArray[np.int64] | None:
        """The nodes in space (K,) that a branch's nodes are, where it lies upon limbs of other views."""
        other = np.flatnonzero(self.view != path.view)
        seen = view.camera.project(self.position)
        way = seen - seen[np.maximum(self.parent, 0)]
        xy = view.branches.xy[np.concatenate([[path.base], path.nodes])]
        gap, nearest = cKDTree(seen[other]).query(xy[1:])
        step, theirs = np.diff(xy, axis=0), way[other[nearest]]
        turn = np.sum(step * theirs, axis=1)
        turn /= np.maximum(np.hypot(*step.T) * np.hypot(*theirs.T), 1e-12)
        length = np.hypot(*step.T)
        here = (gap < near * view.camera.px_per_metre) & (turn > ALIKE)
        return other[nearest] if length[here].sum() >= EXPLAINED * length.sum() else None

    def append(self, path: _Path, base: int, position: NDArray[np.float64], radius: NDArray[np.float64]) -> None:
        first = len(self.position)
        fresh = np.arange(first, first + len(position))
        self.position = np.concatenate([self.position, position])
        self.parent = np.concatenate([self.parent, [base], fresh[:-1]])
        self.radius = np.concatenate([self.radius, radius])
        self.view = np.concatenate([self.view, np.full(len(fresh), path.view)])
        self.names[path.view][path.nodes] = fresh

    def eased(self, views: Sequence[View]) -> Limbs:
        """The limbs, with depths that change smoothly along them; where they appear in their own views stays."""
        position, parent = self.position.copy(), self.parent
        onward = main_child(height_above_tips(position, parent), parent)
        for _ in range(EASING):
            for index, view in enumerate(views):
                node = np.flatnonzero((self.view == index) & (onward >= 0))
                here, before, after = (view.camera.depth(position[n]) for n in (node, parent[node], onward[node]))
                there = here + 0.5 * (0.5 * (before + after) - here)
                position[node] = view.camera.unproject(view.camera.project(position[node]), there)
        return Limbs(position, parent, self.radius)


def choose_depth(
    index: int,
    xy: NDArray[np.float64],
    bases: NDArray[np.int64],
    placed: NDArray[np.float64],
    evidence: _Evidence,
    *,
    rng: np.random.Generator,
) -> tuple[int, NDArray[np.float64], float]:
    """The base, depths (K,) and share inside the hull that the evidence favours for a branch at xy (K, 2) px.

    Tried are all leans and bends from each of the `bases`, nodes of what is placed so far, (P, 3) m;
    `index` is the view that shows the branch.
    """
    camera, height = evidence.views[index].camera, evidence.height
    others = [k for k in range(len(evidence.views)) if k != index]
    room_of, best = cKDTree(placed), (-np.inf, -1, np.zeros(len(xy)), 0.0)
    for base in bases.tolist():
        begin = placed[base]
        s = np.cumsum(np.hypot(*np.diff(np.concatenate([camera.project(begin[None]), xy]), axis=0).T))
        weight = np.diff(s, prepend=0.0) / max(float(s[-1]), 1e-12)
        luck = rng.normal(0, CHANCE, len(LEANS) * len(BENDS))
        lean, bend = (a.ravel() for a in np.meshgrid(LEANS, BENDS, indexing="ij"))
        for _ in range(2):  # all, then closely around the best
            depth = ways_in_depth(s / camera.px_per_metre, float(camera.depth(begin[None])[0]), lean, bend)
            flat = camera.unproject(np.tile(xy, (len(depth), 1)), depth.ravel())
            inside = (evidence.hull.at(flat) > 0).reshape(depth.shape) @ weight
            likely = (evidence.density.at(flat) > 0).reshape(depth.shape) @ weight
            room = np.minimum(room_of.query(flat)[0] / (APART * height), 1).reshape(depth.shape) @ weight
            score = FULL * inside + LIKELY * likely + SPREAD * room - LEAN * (1 / np.cos(lean) - 1) + luck
            for k in others:
                score += SEEN / len(others) * (_agreement(flat.reshape(*depth.shape, 3), begin, evidence, k) @ weight)
            first = int(np.argmax(score))
            if score[first] > best[0]:
                best = (float(score[first]), base, depth[first], float(inside[first]))
            luck = np.full(len(FINE_LEANS) * len(FINE_BENDS), luck[first])
            around = np.meshgrid(lean[first] + FINE_LEANS, bend[first] + FINE_BENDS, indexing="ij")
            lean, bend = (a.ravel() for a in around)
    return best[1:]


def ways_in_depth(
    s: NDArray[np.float64], begin: float, lean: NDArray[np.float64], bend: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Depths (C, K) m after s (K,) m of way from the depth `begin`, one way a lean and bend (C,), (C,)."""
    t = s / max(float(s[-1]), 1e-12)
    shape = (1 - bend)[:, None] * t + bend[:, None] * t**2
    return np.asarray(begin + np.tan(lean)[:, None] * s[-1] * shape)


def _agreement(
    point: NDArray[np.float64], begin: NDArray[np.float64], evidence: _Evidence, k: int
) -> NDArray[np.float64]:
    """How well ways (C, K, 3) from one base (3,) lie on branches of view k and run as those do: (C, K), at most 1."""
    lines, camera = evidence.lines[k], evidence.views[k].camera
    if lines is None:
        return np.zeros(point.shape[:2])
    whole = np.concatenate([np.broadcast_to(begin, (len(point), 1, 3)), point], axis=1)
    seen = camera.project(whole.reshape(-1, 3)).reshape(*whole.shape[:2], 2)
    gap, nearest = lines.tree.query(seen[:, 1:])
    near = 1 / (1 + (gap / (LOOSE * evidence.height * camera.px_per_metre)) ** 2)
    step = seen[:, :-1] - seen[:, 1:]  # towards the root
    turn = np.sum(step * lines.tangent[nearest], axis=2) / np.maximum(np.linalg.norm(step, axis=2), 1e-9)
    return np.asarray(near * (0.5 + 0.5 * np.maximum(turn, 0)) * np.where(lines.is_taken[nearest], TAKEN, 1.0))
