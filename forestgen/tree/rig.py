"""Rig: joints along the limbs of a tree, few enough for a game, and which of them carry each point."""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.frames import start_normals
from forestgen.tree.growth_binding import bind_mesh
from forestgen.tree.limb_tree import LimbTree, nearest_unit
from forestgen.tree.limbs import unit
from forestgen.tree.model import Leaves, Mesh
from forestgen.tree.skeleton import height_above_tips
from forestgen.tree.sway import Gust, rotations, turns
from forestgen.tree.wind import Wind, wind_of

MOST_JOINTS = 128  # ours: what engines skin in one draw call
CUT = 0.5  # cutting a limb's bone counts half as much as a limb of that length that gets its first
BLEND = 0.25  # of a bone's length to either side of its joint are carried by both bones
WEIGHT_STEPS = 256  # shares are told in so many parts: few values, so that crate takes a byte each
INFLUENCES = 4  # joints of a point, at most: two where the limb leaves its parent's blend, its own, one spare


@dataclass(frozen=True, eq=False)
class Rig:
    """J joints, parents first; joint 0 is the root. A joint's bone runs along its limb to the next one."""

    tree: LimbTree
    wind: Wind
    parent: NDArray[np.int64]  # (J,) -1 for the root
    limb: NDArray[np.int64]  # (J,)
    place: NDArray[np.int64]  # (J,) 0 for the first bone of its limb, 1 for the second, ...
    position: NDArray[np.float64]  # (J, 3) m
    frame: NDArray[np.float64]  # (J, 3, 3) columns are the joint's x, y, z; y along the bone
    first_joint: NDArray[np.int64]  # (L,) of each limb, -1 where it has none and hangs on its parent's
    n_bones: NDArray[np.int64]  # (L,)

    def __post_init__(self) -> None:
        freeze(
            self,
            parent=(np.int64, "J"),
            limb=(np.int64, "J"),
            place=(np.int64, "J"),
            position=(np.float64, "J", 3),
            frame=(np.float64, "J", 3, 3),
            first_joint=(np.int64, "L"),
            n_bones=(np.int64, "L"),
        )

    def __len__(self) -> int:
        return len(self.parent)


@dataclass(frozen=True, eq=False)
class Skin:
    """Which joints carry P points, and by what share; shares of a point add up to 1."""

    joint: NDArray[np.int64]  # (P, INFLUENCES)
    weight: NDArray[np.float64]  # (P, INFLUENCES)

    def __post_init__(self) -> None:
        freeze(self, joint=(np.int64, "P", INFLUENCES), weight=(np.float64, "P", INFLUENCES))


@dataclass(frozen=True, eq=False)
class _Ways:
    """Way along each limb from its pivot, metres; negative inside its parent."""

    knot: NDArray[np.float64]  # (K,) of each knot
    length: NDArray[np.float64]  # (L,) of each limb
    socket: NDArray[np.float64]  # (L,) where it leaves its parent, on the parent's way


def _ways(tree: LimbTree, wind: Wind) -> _Ways:
    limbs = tree.limbs
    point = tree.skeleton.position[limbs.node]
    step = np.concatenate([[0.0], np.linalg.norm(np.diff(point, axis=0), axis=1)])
    begin = limbs.first[:-1]
    way = np.cumsum(step)
    knot = way - way[begin][limbs.limb]
    inside = np.linalg.norm(wind.pivot - point[begin], axis=1)  # the pivot is on the way, near its base
    knot = knot - inside[limbs.limb]
    socket = np.where(limbs.parent >= 0, knot[limbs.socket], 0.0)
    return _Ways(knot, knot[limbs.first[1:] - 1], socket)


def rig_of(tree: LimbTree, most: int = MOST_JOINTS) -> Rig:
    """Joints at the pivots of the limbs that reach farthest, and more along those that are long; `most` in all.

    Raises:
        ValueError: `most` is below 1.
    """
    if most < 1:
        raise ValueError(f"rig_of: a rig has at least 1 joint, not {most}")
    limbs, wind = tree.limbs, wind_of(tree)
    ways = _ways(tree, wind)
    n_bones = _shared_out(tree, ways, most)
    kept = np.flatnonzero(n_bones)
    first_joint = np.full(len(limbs), -1)
    first_joint[kept] = np.cumsum(n_bones[kept]) - n_bones[kept]
    limb = np.repeat(kept, n_bones[kept])
    place = np.arange(len(limb)) - first_joint[limb]
    position = _on_way(tree, ways, limb, ways.length[limb] * place / n_bones[limb])
    end = _on_way(tree, ways, limb, ways.length[limb] * (place + 1) / n_bones[limb])
    below = np.maximum(limbs.parent[limb], 0)  # kept too: limbs come after their parents
    parent = np.where(
        place > 0, np.arange(len(limb)) - 1, first_joint[below] + _bone_at(ways, n_bones, below, ways.socket[limb])
    )
    parent[0] = -1
    along = unit(end - position)
    across = start_normals(along, np.array([0.0, 0.0, 1.0]))
    frame = np.stack([np.cross(along, across), along, across], axis=2)
    return Rig(tree, wind, parent, limb, place, position, frame, first_joint, n_bones)


def _shared_out(tree: LimbTree, ways: _Ways, most: int) -> NDArray[np.int64]:
    """Number of bones (L,) of each limb: whichever limb or cut makes the longest piece movable comes next."""
    limbs = tree.limbs
    base = limbs.node[limbs.first[:-1]]
    head = limbs.node[np.minimum(limbs.first[:-1] + (limbs.parent >= 0), limbs.first[1:] - 1)]
    reach = height_above_tips(tree.skeleton.position, tree.skeleton.parent)[head]
    reach += np.linalg.norm(tree.skeleton.position[head] - tree.skeleton.position[base], axis=1)
    on: list[list[int]] = [[] for _ in range(len(limbs))]
    for child, below in enumerate(limbs.parent.tolist()):
        if below >= 0:
            on[below].append(child)
    n_bones = np.zeros(len(limbs), np.int64)
    queue: list[tuple[float, int]] = [(-np.inf, 0)]
    for _ in range(most):
        if not queue:
            break
        _, limb = heappop(queue)
        if not n_bones[limb]:
            for child in on[limb]:
                heappush(queue, (-float(reach[child]), child))
        n_bones[limb] += 1
        heappush(queue, (-CUT * float(ways.length[limb]) / int(n_bones[limb]), limb))
    return n_bones


def _on_way(tree: LimbTree, ways: _Ways, limb: NDArray[np.int64], way: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (Q, 3) of limbs (Q,) at ways (Q,)."""
    limbs, point = tree.limbs, tree.skeleton.position[tree.limbs.node]
    apart = 2 * float(np.abs(ways.knot).max()) + 1.0  # limbs one after another on one axis
    axis = ways.knot + apart * limbs.limb
    return np.stack([np.interp(way + apart * limb, axis, point[:, k]) for k in range(3)], axis=1)


def _bone_at(
    ways: _Ways, n_bones: NDArray[np.int64], limb: NDArray[np.int64], way: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Which bone (Q,) of limbs (Q,) covers ways (Q,)."""
    share = way / np.maximum(ways.length[limb], 1e-12)
    return np.clip((share * n_bones[limb]).astype(np.int64), 0, np.maximum(n_bones[limb], 1) - 1)


def skin_of_mesh(rig: Rig, mesh: Mesh) -> Skin:
    """What carries the points of a branch mesh."""
    bound = bind_mesh(mesh.points, mesh.faces, rig.tree.skeleton)
    return _skin(rig, bound.node, bound.part)


def skin_of_leaves(rig: Rig, leaves: Leaves) -> Skin:
    """What carries the feet of leaves (K,): each leaf goes as a whole with the wood under its foot."""
    return _skin(rig, *nearest_unit(leaves.position, rig.tree.skeleton))


def _skin(rig: Rig, node: NDArray[np.int64], part: NDArray[np.float64]) -> Skin:
    """What carries points at shares `part` (P,) of the pieces of wood that end at nodes (P,)."""
    tree, limbs = rig.tree, rig.tree.limbs
    ways = _ways(tree, rig.wind)
    limb = tree.limb_of_node[node]
    knot_of_node = np.zeros(len(tree.skeleton), np.int64)
    knot_of_node[limbs.node[::-1]] = np.arange(len(limbs.node))[::-1]  # the first: a side limb's base is its parent's
    own = np.ones(len(limbs.node), bool)
    own[limbs.first[1:-1]] = False
    knot_of_node[limbs.node[own]] = np.flatnonzero(own)
    knot = knot_of_node[node]
    before = np.maximum(knot - 1, limbs.first[limb])
    way = ways.knot[before] + part * (ways.knot[knot] - ways.knot[before])
    home, at = np.arange(len(limbs)), np.full(len(limbs), np.nan)  # NaN: the point's own way
    for child in np.flatnonzero(rig.n_bones == 0):
        below = limbs.parent[child]
        home[child], at[child] = home[below], ways.socket[child] if np.isnan(at[below]) else at[below]
    way = np.where(np.isnan(at[limb]), way, at[limb])
    return _blended(rig, ways, home[limb], way)


def _blended(rig: Rig, ways: _Ways, limb: NDArray[np.int64], way: NDArray[np.float64]) -> Skin:
    """Joints and shares of points at ways (P,) of limbs (P,) that have joints.

    About a joint both bones carry, from one to the other over BLEND of a bone. About a limb's first joint
    the other one is whatever carries its parent there.
    """
    count, long = rig.n_bones[limb], ways.length[limb]
    bone = _bone_at(ways, rig.n_bones, limb, way)
    span = np.maximum(long / count, 1e-12)
    place = way / span  # in bones
    nearest = np.clip(np.round(place), 0, count - 1).astype(np.int64)
    t = np.clip((place - nearest) / (2 * BLEND) + 0.5, 0, 1)
    upper = t * t * (3 - 2 * t)
    is_near = np.abs(place - nearest) < BLEND
    is_near |= (nearest == 0) & (place < BLEND)
    first = rig.first_joint[limb]
    joint = np.zeros((len(limb), INFLUENCES), np.int64)
    weight = np.zeros((len(limb), INFLUENCES))
    joint[:, 0], weight[:, 0] = first + bone, 1.0
    inner = is_near & (nearest > 0)
    joint[inner, 0], weight[inner, 0] = (first + nearest)[inner], upper[inner]
    joint[inner, 1], weight[inner, 1] = (first + nearest - 1)[inner], 1 - upper[inner]
    base = np.flatnonzero(is_near & (nearest == 0) & (limb > 0))
    if len(base):
        stem, inverse = np.unique(limb[base], return_inverse=True)
        below = _blended(rig, ways, rig.tree.limbs.parent[stem], ways.socket[stem])
        joint[base, 0], weight[base, 0] = first[base], upper[base]
        joint[base, 1:] = below.joint[inverse, : INFLUENCES - 1]
        weight[base, 1:] = (1 - upper[base])[:, None] * below.weight[inverse, : INFLUENCES - 1]
    weight = np.round(WEIGHT_STEPS * weight / weight.sum(axis=1, keepdims=True)) / WEIGHT_STEPS
    weight[:, 0] += 1 - weight.sum(axis=1)
    joint[weight == 0] = 0
    return Skin(joint, weight)


def joint_turns(rig: Rig, gust: Gust) -> NDArray[np.float64]:
    """How each joint (J, 3, 3) is turned against its parent in a gust, about the axes of the tree at rest.

    The bones of a limb share its turn out as a cantilever under an even load has its slope: 4/3 of the
    chord's angle times t (3 - 3 t + t^2), taken at the middle of each bone.
    """
    t = (rig.place + np.array([[-0.5], [0.5]])) / rig.n_bones[rig.limb]
    slope = 4 / 3 * t * (3 - 3 * t + t * t)
    slope[0, rig.place == 0] = 0
    return rotations(turns(rig.wind, gust)[rig.limb] * (slope[1] - slope[0])[:, None])
