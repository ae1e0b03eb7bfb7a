"""Wind data: about which place each limb of a tree turns, how easily, and what hangs on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.growth_binding import bind_mesh
from forestgen.tree.limb_tree import LimbTree, nearest_unit
from forestgen.tree.limbs import Limbs
from forestgen.tree.model import Leaves, Mesh

# Tip stiffness of a cantilever is 3 E I / L^3 with I = pi r^4 / 4 (Gere & Timoshenko, Mechanics of Materials,
# table of beam deflections): for one wood it goes with r^4 / L^3. Ours: what counts as half stiff, and the power
# that spreads the six decades between twigs and trunks over 0 to 1.
HALF_STIFF = 1e-8  # m: a limb of 1 cm radius and 1 m length
SPREAD = 0.5
STEPS = 128  # phase and stiffness are rounded to that many parts: an index of so few takes a byte in crate
GOLDEN = 0.6180339887498949  # of a cycle between one side limb and the next: no two neighbours swing together


@dataclass(frozen=True, eq=False)
class Wind:
    """L limbs of a tree, parents first; limb 0 is the trunk. Metres, in the tree's own space."""

    pivot: NDArray[np.float64]  # (L, 3) m, where the limb comes out of its parent; the root for the trunk
    axis: NDArray[np.float64]  # (L, 3) m, from the pivot to the limb's farthest place
    level: NDArray[np.int64]  # (L,) 0 the trunk, 1 its side limbs, ...
    phase: NDArray[np.float64]  # (L,) of a cycle, in [0, 1)
    stiffness: NDArray[np.float64]  # (L,) in [0, 1]: 0 bends freely, 1 not at all
    parent: NDArray[np.int64]  # (L,) the limb it stands on, -1 for the trunk

    def __post_init__(self) -> None:
        freeze(
            self,
            pivot=(np.float64, "L", 3),
            axis=(np.float64, "L", 3),
            level=(np.int64, "L"),
            phase=(np.float64, "L"),
            stiffness=(np.float64, "L"),
            parent=(np.int64, "L"),
        )

    def __len__(self) -> int:
        return len(self.parent)

    def bend(self, points: NDArray[np.float64], limb: NDArray[np.int64]) -> NDArray[np.float64]:
        """Share (P,) of a limb's whole turn that points (P, 3) on limbs (P,) take: 0 to its pivot, 1 at its end.

        The chord's angle of a cantilever under an even load (Gere & Timoshenko): t (6 - 4 t + t^2) / 3.
        """
        axis = self.axis[limb]
        along = np.einsum("pi,pi->p", points - self.pivot[limb], axis)
        t = np.clip(along / np.maximum(np.einsum("pi,pi->p", axis, axis), 1e-300), 0, 1)
        return np.asarray(t * (6 - 4 * t + t * t) / 3)


def wind_of(tree: LimbTree) -> Wind:
    """What moves each limb (L,) of a tree in the wind. Known from the skeleton: all levels of detail share it."""
    limbs, skeleton = tree.limbs, tree.skeleton
    point, radius = skeleton.position[limbs.node], skeleton.radius[limbs.node]
    begin, last = limbs.first[:-1], limbs.first[1:] - 1
    step = np.concatenate([[0.0], np.linalg.norm(np.diff(point, axis=0), axis=1)])
    way = np.cumsum(step)
    length = way[last] - way[begin]
    inside = np.where(limbs.parent >= 0, np.minimum(radius[begin], length / 2), 0.0)  # way within the parent's wood
    pivot = np.stack([np.interp(way[begin] + inside, way, point[:, k]) for k in range(3)], axis=1)
    limb = limbs.limb
    far = np.linalg.norm(point - pivot[limb], axis=1)
    far[begin] = 0
    farthest = np.lexsort((far, limb))[last]
    level, phase = _levels_and_phases(limbs)
    own_radius = np.where(limbs.parent >= 0, radius[np.minimum(begin + 1, last)], radius[begin])
    stiff = np.round(STEPS * stiffness(own_radius, length)) / STEPS
    return Wind(pivot, point[farthest] - pivot, level, np.round(STEPS * phase) % STEPS / STEPS, stiff, limbs.parent)


def stiffness(radius: NDArray[np.float64], length: NDArray[np.float64]) -> NDArray[np.float64]:
    """Stiffness (L,) in [0, 1) of limbs with base radius and length (L,) in metres: rises with r^4 / L^3."""
    beam = radius**4 / np.maximum(length, 1e-9) ** 3
    return np.asarray(1 / (1 + (HALF_STIFF / np.maximum(beam, 1e-300)) ** SPREAD))


def _levels_and_phases(limbs: Limbs) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Level and phase (L,): each side limb is a golden share of a cycle behind the one before it on its parent."""
    order = np.lexsort((limbs.socket, limbs.parent))
    parent = limbs.parent[order]
    rank = np.empty(len(limbs), np.int64)
    rank[order] = np.arange(len(limbs)) - np.searchsorted(parent, parent)
    level, phase = [0] * len(limbs), [0.0] * len(limbs)
    ahead = (GOLDEN * (rank + 1)).tolist()
    for child, above in enumerate(limbs.parent.tolist()):
        if above >= 0:
            level[child] = level[above] + 1
            phase[child] = (phase[above] + ahead[child]) % 1.0
    return np.array(level, np.int64), np.array(phase)


def limb_of_mesh(mesh: Mesh, tree: LimbTree) -> NDArray[np.int64]:
    """The limb (P,) that each point of a branch mesh belongs to; of any level of detail."""
    if not len(mesh.points):
        return np.zeros(0, np.int64)
    return tree.limb_of_node[bind_mesh(mesh.points, mesh.faces, tree.skeleton).node]


def limb_of_leaves(leaves: Leaves, tree: LimbTree) -> NDArray[np.int64]:
    """The limb (K,) that each leaf hangs on: that of the nearest piece of wood."""
    return tree.limb_of_node[nearest_unit(leaves.position, tree.skeleton)[0]]
