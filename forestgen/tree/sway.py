"""Sway: a tree blown by the wind, from its wind data alone, as a shader would do it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.foliage_poses import quaternions
from forestgen.tree.growth_leaves import multiply
from forestgen.tree.limb_tree import limb_tree
from forestgen.tree.limbs import unit
from forestgen.tree.model import Leaves, Mesh, TreeModel
from forestgen.tree.wind import Wind, limb_of_leaves, limb_of_mesh

# How a tree swings. Trunks of grown trees sway at 0.1 to 0.5 Hz, their branches at 1 Hz and above (James, Haritos &
# Ades 2006, "Mechanical stability of trees under dynamic loads"); shares of lean and gust are ours. All swings are
# multiples of an eighth of a hertz, so that the whole repeats after PERIOD.
TRUNK_HZ = 0.25
HZ_PER_LEVEL = 0.25
LEAN, GUST, SIDE = 0.6, 0.4, 0.3  # of the strength: steady, along the wind, across it
SIDE_HZ = 1.5  # gusts across come that much faster than those along
PERIOD = 8.0  # s


@dataclass(frozen=True)
class Gust:
    """The wind at a moment."""

    time: float  # s
    direction: float = 0.0  # radians about +Y in which it blows; 0 towards +X, a quarter turn towards -Z
    strength: float = 0.2  # radians by which a limb without any stiffness bends, across the wind


def turns(wind: Wind, gust: Gust) -> NDArray[np.float64]:
    """The rotation vector (L, 3) of each limb at its end: its length is the angle in radians."""
    along = np.array([np.cos(gust.direction), 0.0, -np.sin(gust.direction)])
    across = np.array([np.sin(gust.direction), 0.0, np.cos(gust.direction)])
    cycle = (TRUNK_HZ + HZ_PER_LEVEL * wind.level) * gust.time + wind.phase
    blow = (LEAN + GUST * np.sin(2 * np.pi * cycle))[:, None] * along
    blow = blow + (SIDE * np.sin(2 * np.pi * (SIDE_HZ * cycle + wind.phase)))[:, None] * across
    return np.asarray(gust.strength * (1 - wind.stiffness)[:, None] * np.cross(unit(wind.axis), blow))


def rotations(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrices (P, 3, 3) of rotation vectors (P, 3), by Rodrigues' formula."""
    angle = np.linalg.norm(vector, axis=1)[:, None, None]
    x, y, z = unit(vector).T
    zero = np.zeros_like(x)
    cross = np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), -1, 0)
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross))


def carried(wind: Wind, turn: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How the wood under each limb moves it: a rotation (L, 3, 3), then a shift (L, 3).

    A limb is carried by its parent as far as that bends at the limb's pivot, after what carries the parent.
    """
    rotation, shift = np.tile(np.eye(3), (len(wind), 1, 1)), np.zeros((len(wind), 3))
    for level in range(1, int(wind.level.max()) + 1):
        limb = np.flatnonzero(wind.level == level)
        below = wind.parent[limb]
        share = wind.bend(wind.pivot[limb], below)
        own = rotations(turn[below] * share[:, None])
        stay = wind.pivot[below] - np.einsum("lij,lj->li", own, wind.pivot[below])
        rotation[limb] = rotation[below] @ own
        shift[limb] = np.einsum("lij,lj->li", rotation[below], stay) + shift[below]
    return rotation, shift


def blown(
    wind: Wind, limb: NDArray[np.int64], points: NDArray[np.float64], gust: Gust
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where points (P, 3) on limbs (P,) are in a gust, and how each has turned (P, 3, 3)."""
    turn = turns(wind, gust)
    rotation, shift = carried(wind, turn)
    own = rotations(turn[limb] * wind.bend(points, limb)[:, None])
    pivot = wind.pivot[limb]
    bent = pivot + np.einsum("pij,pj->pi", own, points - pivot)
    moved = np.einsum("pij,pj->pi", rotation[limb], bent) + shift[limb]
    return np.asarray(moved), np.asarray(rotation[limb] @ own)


def sway(model: TreeModel, wind: Wind, gust: Gust) -> TreeModel:
    """A tree in a gust: branches bent, leaves carried and turned with them. `wind` is the model's own."""
    tree = limb_tree(model.skeleton)
    points, turned = blown(wind, limb_of_mesh(model.mesh, tree), model.mesh.points, gust)
    normals = np.einsum("pij,pj->pi", turned, model.mesh.normals)
    mesh = Mesh(points, normals, model.mesh.uv, model.mesh.faces)
    foot, turned = blown(wind, limb_of_leaves(model.leaves, tree), model.leaves.position, gust)
    turn = multiply(quaternions(turned), model.leaves.orientation)
    turn = turn / np.maximum(np.linalg.norm(turn, axis=1, keepdims=True), 1e-300)
    leaves = Leaves(foot, turn, model.leaves.size, model.leaves.prototype)
    return replace(model, mesh=mesh, leaves=leaves)
