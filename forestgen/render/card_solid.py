"""What stays solid beside a tree's cards: the leaves and the ends of twigs that its outlines hang on.

Cards show a thing where it is only to those who look straight onto them; from aside it is up to half a slab away,
and what is thinner than a texel is dashed. Inside a crown nobody sees that, at its outline it is all that one sees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.render.card_outline import Outlines, outlines_of
from forestgen.render.card_wood import SINK
from forestgen.tree.limbs import limbs_along, merge_coincident, plant, thickest_child, unit
from forestgen.tree.lod_outline import depth_below_outline
from forestgen.tree.model import Bark, Mesh, TreeModel
from forestgen.tree.places import leaf_matrices
from forestgen.tree.skeleton import Skeleton

MOST = 600  # leaves and twigs, of two and four triangles each
FEW = 0.1  # of a tree's leaves, at most so many
OUTER = 0.03  # of the tree's longest extent: what lies deeper inside never draws an outline
GRAIN = 0.01  # of the height: how far points that stand for a thing are apart; gaps of four times that are closed
THICK = 0.1  # radius, over GRAIN, from which on wood is as wide as it is, AROUND points a ring
AROUND = 8
LENGTH = 1 / 12  # how much of a twig is solid, as a share of the height
STRAIGHT = 1 / 250  # how far it may bend, likewise


@dataclass(frozen=True, eq=False)
class Solid:
    """What of a tree stays solid, A leaves and B ends of twigs, and the outlines that they draw."""

    outlines: Outlines
    leaf: NDArray[np.int64]  # (A,)
    twig: NDArray[np.float64]  # (B, 2, 3) m, where the solid end begins, and its tip
    radius: NDArray[np.float64]  # (B, 2) m, at both

    def __post_init__(self) -> None:
        freeze(self, leaf=(np.int64, "A"), twig=(np.float64, "B", 2, 3), radius=(np.float64, "B", 2))


def solid_things(model: TreeModel) -> Solid:
    """The leaves and twigs that most of a tree's outlines hang on; the same for the same tree."""
    skeleton = plant(merge_coincident(model.skeleton), SINK * model.height)
    limbs = limbs_along(skeleton, thickest_child(skeleton))
    tip = limbs.node[limbs.first[1:] - 1]
    n = len(model.leaves)
    is_outer = depth_below_outline(np.concatenate([model.leaves.position, skeleton.position])) < OUTER
    blade, leaf = _blades(model, np.flatnonzero(is_outer[:n]))
    twig = np.flatnonzero(is_outer[n:][tip])
    inner = np.concatenate([model.leaves.position, _along(skeleton, GRAIN * model.height)])
    points = np.concatenate([inner, blade, skeleton.position[tip[twig]]])
    owner = np.concatenate([np.full(len(inner), -1), leaf, n + twig])
    outlines, leads = outlines_of(points, owner, model.height)
    chosen = np.argsort(-leads, kind="stable")[: min(MOST, np.count_nonzero(leads))]
    limb = np.sort(chosen[chosen > n]) - n  # the first limb is the trunk
    starts = [
        first + straight_end(skeleton.position[limbs.node[first:end]], STRAIGHT * model.height, LENGTH * model.height)
        for first, end in zip(limbs.first[limb].tolist(), limbs.first[limb + 1].tolist(), strict=True)
    ]
    knot = np.array(starts, np.int64)
    return Solid(
        outlines=outlines,
        leaf=np.sort(chosen[chosen < n][: int(FEW * n)]),
        twig=np.stack([skeleton.position[limbs.node[knot]], skeleton.position[tip[limb]]], axis=1),
        radius=np.stack([skeleton.radius[limbs.node[knot + 1]], skeleton.radius[tip[limb]]], axis=1),
    )


def _blades(model: TreeModel, leaf: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points (N, 3) all over some leaves, no further apart than GRAIN, and the leaf of each (N,)."""
    places = leaf_matrices(model.leaves)[leaf]
    points, owner = [np.zeros((0, 3))], [np.zeros(0, np.int64)]
    for k, prototype in enumerate(model.atlas.prototypes):
        mine = np.flatnonzero(model.leaves.prototype[leaf] == k)
        longest = float(model.leaves.size[leaf[mine]].max(initial=0)) * np.ptp(prototype.points, axis=0).max()
        n = int(np.ceil(longest / (GRAIN * model.height)))
        flat = prototype.points if n < 3 else np.concatenate(_lattice(n) @ prototype.points[prototype.faces])
        blade = flat @ places[mine, :3, :3].swapaxes(1, 2) + places[mine, None, :3, 3]
        points.append(blade.reshape(-1, 3))
        owner.append(np.repeat(leaf[mine], len(flat)))
    return np.concatenate(points), np.concatenate(owner)


def _lattice(n: int) -> NDArray[np.float64]:
    """Barycentric coordinates (N, 3) of points all over a triangle, n steps along each side."""
    i, j = np.divmod(np.arange((n + 1) ** 2), n + 1)
    inside = i + j <= n
    return np.stack([i, j, n - i - j], axis=1)[inside] / n


def _along(skeleton: Skeleton, apart: float) -> NDArray[np.float64]:
    """Points (N, 3) along a skeleton, no further apart than so many metres, and around it where it is thick."""
    start, end = skeleton.position[skeleton.parent[1:]], skeleton.position[1:]
    n = np.maximum(np.ceil(np.linalg.norm(end - start, axis=1) / apart).astype(np.int64), 1)
    edge = np.repeat(np.arange(len(n)), n)
    t = (1 + np.arange(len(edge)) - np.repeat(np.cumsum(n) - n, n))[:, None] / n[edge, None]
    axis = start[edge] + t * (end - start)[edge]
    radius = skeleton.radius[1:][edge]
    thick = np.flatnonzero(radius > THICK * apart)
    ahead = unit(end - start)[edge[thick]]
    aside = _aside(ahead)
    turn = 2 * np.pi * np.arange(AROUND)[:, None, None] / AROUND
    outward = np.cos(turn) * aside + np.sin(turn) * np.cross(ahead, aside)
    around = axis[thick] + radius[thick, None] * outward
    return np.concatenate([skeleton.position[:1], axis, around.reshape(-1, 3)])


def _aside(ahead: NDArray[np.float64]) -> NDArray[np.float64]:
    """A unit vector across each of some (N, 3)."""
    is_upright = np.abs(ahead[:, 1]) > 0.9
    return unit(np.cross(ahead, np.where(is_upright[:, None], [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])))


def straight_end(points: NDArray[np.float64], stray: float, longest: float) -> int:
    """The knot of a limb (K, 3) from which on to its tip it bends by no more than `stray` metres.

    As far back as it can be within `longest` metres of the tip; the last but one at least.
    """
    for first in range(len(points) - 2):
        chord, inner = points[-1] - points[first], points[first + 1 : -1] - points[first]
        length = float(np.linalg.norm(chord))
        if 0 < length <= longest and np.linalg.norm(np.cross(inner, chord), axis=1).max() <= stray * length:
            return first
    return len(points) - 2


def twig_wedges(solid: Solid, bark: Bark) -> Mesh:
    """The solid ends of twigs as wedges: an edge at either end, one across the other, as wide as a round twig.

    Of all shapes this is the one with fewest triangles that is as wide at the tip as at the foot: a cone's tip is
    too thin to be seen. From one side the one edge is seen end-on, from another the other.
    """
    ahead = unit(solid.twig[:, 1] - solid.twig[:, 0])
    aside = _aside(ahead)
    outward = np.stack([aside, -aside, np.cross(ahead, aside), -np.cross(ahead, aside)], axis=1)
    end = [0, 0, 1, 1]
    points = solid.twig[:, end] + (np.pi / 2 * solid.radius)[:, end, None] * outward
    length = np.linalg.norm(solid.twig[:, 1] - solid.twig[:, 0], axis=1)
    uv = np.zeros((len(points), 4, 2))
    uv[:, :, 0] = [0.0, 1.0, 0.0, 1.0]
    uv[:, 2:, 1] = length[:, None] / bark.height_m
    index = 4 * np.arange(len(points))[:, None, None]
    faces = np.array([[0, 2, 3], [1, 3, 2], [0, 1, 2], [1, 0, 3]]) + index
    return Mesh(points.reshape(-1, 3), outward.reshape(-1, 3), uv.reshape(-1, 2), faces.reshape(-1, 3))
