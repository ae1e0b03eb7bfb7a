"""Visible limbs in space: each traced branch gets the depth at which the other views show wood, or leaves, too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.tree.branch_paths import cut_into_paths
from forestgen.tree.density import DensityVolume
from forestgen.tree.lift.direction_field import graph_points
from forestgen.tree.lift.flow_trunk import Limbs, metres_of, trunk_in_space, trunk_nodes, trunk_top
from forestgen.tree.skeleton import branch_order, height_above_tips, main_child
from forestgen.tree.view import View

LEANS = np.deg2rad(np.linspace(-60, 60, 25))  # out of the photo's plane
BENDS = np.array([-0.6, -0.3, 0.0, 0.3, 0.6])  # share of the lean that is gained late (or, negative, early)
SHORTEST = 0.02  # of the height: shorter branches are left to the flow
NEAR = 0.02  # of the height: lines so near to each other in a photo are one branch
ALIKE = 0.85  # least cosine between such lines
EXPLAINED = 0.6  # share of a branch that is near to lines of others
LOOSE = 0.03  # of the height: by how much photos that were arranged by hand may disagree
APART = 0.12  # of the height: limbs farther from each other than that do not crowd
FULL, SEEN, SPREAD, LEAN = 1.0, 1.0, 0.5, 0.15  # what counts in choosing a depth: density, other views, room, plainness
CHANCE = 0.04  # spread of the choice by the seed


@dataclass(frozen=True, eq=False)
class _Path:
    """A branch of one view, from where it leaves its parent."""

    view: int
    base: int  # node of the view's graph
    nodes: NDArray[np.int64]
    generation: int
    length: float  # m


def limbs_in_space(views: Sequence[View], density: DensityVolume, *, rng: np.random.Generator) -> Limbs:
    """The trunk and all branches that any view shows, in space: the longest of each generation first.

    In the view that shows it a branch appears where it was traced. A branch that another view's
    branch, already in space, lies upon is the same one and is left out.
    """
    top = min(trunk_top(view) for view in views)
    height = float((density.low + density.edge * np.array(density.alpha.shape))[1])
    placed = _Placed(trunk_in_space(views, top), len(views))
    graphs = [cKDTree(graph_points(v.branches.xy, v.branches.parent, 3.0)[0]) for v in views]
    paths: list[_Path] = []
    for index, view in enumerate(views):
        found, on_trunk = _paths_of(view, index, top)
        placed.name_trunk(index, view, on_trunk)
        paths += [path for path in found if path.length >= SHORTEST * height]
    for path in sorted(paths, key=lambda path: (path.generation, -path.length, path.view)):
        view = views[path.view]
        xy = view.branches.xy[path.nodes]
        base = placed.base_of(path, view)
        same = placed.explains(path, view, NEAR * height)
        if same is not None:
            placed.names[path.view][path.nodes] = same
            continue
        depth = _depth(path, xy, base, views, graphs, placed, density, height, rng=rng)
        position = view.camera.unproject(xy, depth)
        placed.append(path, base, position, metres_of(view.branches.radius_px[path.nodes], view.camera, position))
    return placed.limbs()


def _paths_of(view: View, index: int, top: float) -> tuple[list[_Path], NDArray[np.int64]]:
    """Branches of a view without the trunk up to the height `top`, and the trunk's nodes."""
    graph, camera = view.branches, view.camera
    trunk = trunk_nodes(view)
    trunk = trunk[camera.unproject(graph.xy[trunk])[:, 1] <= top * (1 + 1e-9)]
    is_trunk = np.zeros(len(graph), bool)
    is_trunk[trunk] = True
    flat = graph.xy / camera.px_per_metre
    order = branch_order(graph.parent, main_child(height_above_tips(flat, graph.parent), graph.parent))
    found = []
    for nodes in cut_into_paths(flat, graph.parent, 0.05 * float(np.ptp(flat[:, 1]) + 1e-9)).nodes:
        nodes = nodes[~is_trunk[nodes]]
        if len(nodes):
            base = int(graph.parent[nodes[0]])
            way = flat[np.concatenate([[base], nodes])]
            length = float(np.hypot(*np.diff(way, axis=0).T).sum())
            found.append(_Path(index, base, nodes, int(order[nodes[0]]), length))
    return found, trunk


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

    def base_of(self, path: _Path, view: View) -> int:
        """The node in space that a branch leaves from: its parent's, or what appears nearest to its base."""
        known = int(self.names[path.view][path.base])
        if known >= 0:
            return known
        return int(np.argmin(np.hypot(*(view.camera.project(self.position) - view.branches.xy[path.base]).T)))

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

    def limbs(self) -> Limbs:
        return Limbs(self.position, self.parent, self.radius)


def _depth(
    path: _Path,
    xy: NDArray[np.float64],
    base: int,
    views: Sequence[View],
    graphs: Sequence[cKDTree],
    placed: _Placed,
    density: DensityVolume,
    height: float,
    *,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Depths (K,) of a branch in its photo: of all leans and bends the one that other views and density favour."""
    camera = views[path.view].camera
    begin = placed.position[base]
    way = np.concatenate([camera.project(begin[None]), xy])
    s = np.cumsum(np.hypot(*np.diff(way, axis=0).T)) / camera.px_per_metre
    lean, bend = (a.ravel() for a in np.meshgrid(LEANS, BENDS, indexing="ij"))
    t = s / max(s[-1], 1e-12)
    shape = (1 - bend)[:, None] * t + bend[:, None] * t**2
    depth = float(camera.depth(begin[None])[0]) + np.tan(lean)[:, None] * s[-1] * shape
    point = camera.unproject(np.tile(xy, (len(lean), 1)), depth.ravel())

    def mean(value: NDArray[np.float64]) -> NDArray[np.float64]:
        weight = np.gradient(s) if len(s) > 1 else np.ones(1)
        return np.asarray(value.reshape(len(lean), -1) @ weight / weight.sum())

    score = FULL * mean((density.at(point) > 0).astype(float))
    others = [k for k in range(len(views)) if k != path.view]
    for k in others:
        gap, _ = graphs[k].query(views[k].camera.project(point))
        gap /= LOOSE * height * views[k].camera.px_per_metre
        score += SEEN / len(others) * mean(1 / (1 + gap**2))
    room, _ = cKDTree(placed.position).query(point)
    score += SPREAD * mean(np.minimum(room / (APART * height), 1))
    score -= LEAN * (1 / np.cos(lean) - 1)
    score += rng.normal(0, CHANCE, len(score))
    return np.asarray(depth[int(np.argmax(score))])
