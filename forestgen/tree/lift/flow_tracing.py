"""Particle tracing: particles flow to the root, join, and leave a branching graph (Neubert et al. 2007, sec. 6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order
from scipy.spatial import cKDTree

from forestgen.arrays import freeze
from forestgen.camera import Camera
from forestgen.tree.lift.direction_field import DirectionField
from forestgen.tree.lift.flow_kernels import enter_cells, meet_traces, runge_kutta

MOST_CELLS = 2_000_000
WALK = 6  # nodes of a limb that are tried for a joint, half a joining distance from each other
WAY_BACK = 0.5  # least cosine between a particle's way and the way over to the limb node where it ends


@dataclass(frozen=True, kw_only=True)
class FlowRules:
    """How particles move; weights count against each other, metres are of the tree's own space."""

    steps: int
    speed: float  # m a step
    inertia: float  # steps that one particle needs to turn
    inertia_growth: float  # exponent of the number of joined particles in their mass
    to_field: float
    to_neighbour: float
    to_base: float
    to_limb: float
    limb_share: float  # h of equation 3 for the limbs in space
    sight: float  # m, how far a neighbour attracts
    join: float  # m, particles nearer than that join
    floor: float  # m, particles lower than that are at the tree's base
    join_traces: bool  # also with the traces of particles that have passed
    least_turn: float  # cosine between a particle's way and a trace that it joins


@dataclass(frozen=True, eq=False)
class Graph:
    """A rooted branching graph. N nodes; node 0 is the root. The number of tips beyond is that of the particles."""

    position: NDArray[np.float64]  # (N, 3) m
    parent: NDArray[np.int64]  # (N,) parent[0] == -1, else parent[i] < i
    limb: NDArray[np.int64]  # (N,) the node of the given limbs that this is, -1 where a particle passed

    def __post_init__(self) -> None:
        freeze(self, position=(np.float64, "N", 3), parent=(np.int64, "N"), limb=(np.int64, "N"))


def trace_particles(
    start: NDArray[np.float64],
    limb_position: NDArray[np.float64],
    limb_parent: NDArray[np.int64],
    cameras: Sequence[Camera],
    fields: Sequence[DirectionField],
    rules: FlowRules,
) -> Graph:
    """Procedure ParticleTrace: from start (N, 3) m to the limbs (L, 3), of which node 0 is the root.

    The limbs are what is already known of the tree, at least its root. Particles that are still on
    their way after the last step go straight to the nearest place that leads to the root.
    """
    lens = np.array([lens_of(camera) for camera in cameras]).reshape(len(cameras), 15)
    grid = np.array([[*field.low, *field.step] for field in fields]).reshape(len(fields), 4)
    vector = np.array([field.vector for field in fields]) if fields else np.zeros((0, 2, 2, 2))
    limbs = _Limbs(limb_position, limb_parent)
    traces = _Traces(start, limb_position, rules.join)
    x, v = start.copy(), np.zeros_like(start)
    mass = np.full(len(start), rules.inertia)
    count, name, tip = np.ones(len(start)), np.arange(len(start)), np.arange(len(start))

    for _ in range(rules.steps):
        if not len(x):
            break
        partner, gap = nearest_neighbour(x)
        steady = limbs.pull(x, rules)
        steady += _towards(x, x[partner], np.where(gap < rules.sight, rules.to_neighbour, 0.0))
        runge_kutta(x, v, mass, steady, lens, grid, vector, rules.to_field, rules.speed)
        tip = traces.extend(tip, x, name)
        lost, end = limbs.caught(x, v, rules)
        traces.onward[tip[lost]] = -2 - end
        if rules.join_traces:
            lost[~lost] = traces.meet(x[~lost], v[~lost], name[~lost], tip[~lost], rules)
        keep, into = joined_pairs(x, lost, rules.join)
        if len(keep):
            share = (count[into] / (count[keep] + count[into]))[:, None]
            x[keep] += share * (x[into] - x[keep])
            v[keep] += share * (v[into] - v[keep])
            count[keep] += count[into]
            traces.group[name[into]] = name[keep]
            tip[keep] = traces.onward[tip[into]] = traces.extend(tip[keep], x[keep], name[keep])
        mass = rules.inertia * count**rules.inertia_growth
        lost[into] = True
        x, v, mass, count = x[~lost], v[~lost], mass[~lost], count[~lost]
        name, tip = name[~lost], tip[~lost]
    return traces.graph(limbs, tip)


def lens_of(camera: Camera) -> NDArray[np.float64]:
    """A camera as the numbers (15,) that the compiled step reads: axes, root and centre px, px per metre, 1 / m."""
    inverse = 0.0 if camera.focal_px is None else 1 / camera.distance
    middle = np.array(camera.size) / 2
    return np.concatenate([camera.axes.ravel(), camera.root_px, middle, [camera.px_per_metre, inverse]])


def nearest_neighbour(x: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The nearest other point of each of N points (N, 3), and its distance (N,); itself and infinity for a lone one."""
    if len(x) < 2:
        return np.zeros(len(x), np.int64), np.full(len(x), np.inf)
    distance, which = cKDTree(x).query(x, k=2)
    column = np.where(which[:, 0] == np.arange(len(x)), 1, 0)  # of two points in one place, either may come first
    row = np.arange(len(x))
    return which[row, column], distance[row, column]


def joined_pairs(
    x: NDArray[np.float64], lost: NDArray[np.bool_], near: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of points (N, 3), each the other's nearest and nearer than `near`: those that go on, and those that end."""
    alive = np.flatnonzero(~lost)
    partner, gap = nearest_neighbour(x[alive])
    mutual = (gap < near) & (partner[partner] == np.arange(len(alive))) & (np.arange(len(alive)) < partner)
    return alive[mutual], alive[partner[mutual]]


class _Limbs:
    """The wood that is known before the flow: particles are drawn to it and end on it."""

    def __init__(self, position: NDArray[np.float64], parent: NDArray[np.int64]) -> None:
        self.position, self.parent = position, parent
        self.tree = cKDTree(position)
        way = position[np.maximum(parent, 0)] - position
        self.tangent = way / np.maximum(np.linalg.norm(way, axis=1), 1e-12)[:, None]

    def pull(self, x: NDArray[np.float64], rules: FlowRules) -> NDArray[np.float64]:
        """Pulls (N, 3) to the base and to the limbs: equation 3 in space, with a constant h."""
        pull = _towards(x, self.position[:1], np.full(len(x), rules.to_base))
        if rules.to_limb and len(self.position) > 1:
            _, nearest = self.tree.query(x)
            aim = rules.limb_share * _towards(x, self.position[nearest], np.ones(len(x)))
            pull += rules.to_limb * (aim + (1 - rules.limb_share) * self.tangent[nearest])
        return pull

    def caught(
        self, x: NDArray[np.float64], v: NDArray[np.float64], rules: FlowRules
    ) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
        """Which particles (N,) have come to a limb or to the ground, and at which of its nodes (C,) those C end."""
        gap, nearest = self.tree.query(x)
        here = (gap < rules.join) | (x[:, 1] < rules.floor)
        return here, self._ahead(x[here], v[here], nearest[here])

    def _ahead(self, x: NDArray[np.float64], v: NDArray[np.float64], nearest: NDArray[np.int64]) -> NDArray[np.int64]:
        """The first limb node (N,) rootward from the nearest one that lies ahead of a particle: no joint bends back.

        The nearest one itself where none of the next nodes does.
        """
        node, found = nearest.copy(), nearest.copy()
        seeking = np.ones(len(x), bool)
        for _ in range(WALK):
            way = self.position[node] - x
            forward = np.sum(way * v, axis=1) / np.maximum(norm(way) * norm(v), 1e-12) > WAY_BACK
            found[seeking & forward] = node[seeking & forward]
            seeking &= ~forward
            node = np.maximum(self.parent[node], 0)
        return found


class _Traces:
    """The ways of all particles so far. M nodes, in arrays that grow."""

    def __init__(self, start: NDArray[np.float64], limbs: NDArray[np.float64], near: float) -> None:
        n = len(start)
        self.size = 0
        self.node = np.zeros((2 * n, 3))
        self.onward = np.full(2 * n, -1)  # the next node; -1 while the particle moves, -2 - l at its end on limb node l
        self.of = np.zeros(2 * n, np.int64)  # the particle that was here
        self.group = np.arange(n)  # particles whose ways have met point to one of them
        every = np.concatenate([start, limbs])
        self.low = every.min(axis=0) - near
        span = every.max(axis=0) + near - self.low
        self.edge = near
        while float(np.prod(np.ceil(span / self.edge))) > MOST_CELLS:
            self.edge *= 1.25
        self.shape = np.ceil(span / self.edge).astype(np.int64)
        self.head = np.full(int(np.prod(self.shape)), -1)
        self.following = np.full(2 * n, -1)
        self.append(start, np.arange(n))

    def append(self, place: NDArray[np.float64], of: NDArray[np.int64]) -> NDArray[np.int64]:
        """New nodes at place (K, 3), left by the particles `of` (K,): their indices (K,)."""
        first, last = self.size, self.size + len(place)
        if last > len(self.node):
            more = len(self.node) + len(place)
            self.node = np.concatenate([self.node, np.zeros((more, 3))])
            self.onward, self.following = (
                np.concatenate([a, np.full(more, -1)]) for a in (self.onward, self.following)
            )
            self.of = np.concatenate([self.of, np.zeros(more, np.int64)])
        self.node[first:last], self.of[first:last], self.size = place, of, last
        enter_cells(self.node, first, last, self.head, self.following, self.low, self.edge, self.shape)
        return np.arange(first, last)

    def extend(self, tip: NDArray[np.int64], place: NDArray[np.float64], of: NDArray[np.int64]) -> NDArray[np.int64]:
        """Carry the traces with the last nodes `tip` (K,) on to place (K, 3): their new last nodes (K,)."""
        fresh = self.append(place, of)
        self.onward[tip] = fresh
        return fresh

    def meet(
        self,
        x: NDArray[np.float64],
        v: NDArray[np.float64],
        name: NDArray[np.int64],
        tip: NDArray[np.int64],
        rules: FlowRules,
    ) -> NDArray[np.bool_]:
        """Which particles (N,) come to a trace that goes their way; theirs end there."""
        return np.asarray(
            meet_traces(
                x, v, name, tip, self.node, self.onward, self.of, self.group, self.head, self.following,
                self.low, self.edge, self.shape, rules.join, rules.least_turn,
            )
        )  # fmt: skip

    def graph(self, limbs: _Limbs, tip: NDArray[np.int64]) -> Graph:
        """All ways as one graph; `tip` (K,) are the ends of those that did not arrive."""
        n_limb, n = len(limbs.position), self.size
        place = np.concatenate([limbs.position, self.node[:n]])
        onward = self.onward[:n]
        parent = np.concatenate([limbs.parent, np.where(onward >= 0, n_limb + onward, -2 - onward)])
        if len(tip):
            parent[n_limb + tip] = n_limb + tip  # their own parents: what leads there is not reached from the root
            arrived = _from_root(parent)
            _, nearest = cKDTree(place[arrived]).query(self.node[tip])
            parent[n_limb + tip] = arrived[nearest]
        order = _from_root(parent)
        rank = np.empty(len(order), np.int64)
        rank[order] = np.arange(len(order))
        limb = np.where(order < n_limb, order, -1)
        return Graph(place[order], np.where(order > 0, rank[parent[order]], -1), limb)


def _towards(x: NDArray[np.float64], target: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (N, 3) of lengths `weight` (N,) from x (N, 3) towards targets (N, 3); 0 where they coincide."""
    way = target - x
    return np.asarray(way * (weight / np.maximum(np.linalg.norm(way, axis=1), 1e-12))[:, None])


def norm(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lengths (N,) of vectors (N, D)."""
    return np.asarray(np.sqrt(np.sum(vector**2, axis=1)))


def _from_root(parent: NDArray[np.int64]) -> NDArray[np.int64]:
    """The nodes that node 0 is reached from, parents first."""
    child = np.arange(1, len(parent))
    edges = coo_array((np.ones(len(child)), (parent[1:], child)), shape=(len(parent), len(parent))).tocsr()
    return np.asarray(breadth_first_order(edges, 0, return_predecessors=False), np.int64)
