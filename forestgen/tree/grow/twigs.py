"""Twigs: the last generations, grown toward every part of the crown that has no wood near it yet.

Space colonisation (Runions et al. 2007): each attractor pulls at its nearest node; a node that is
pulled grows by a step, and an attractor that is reached is gone. From coarse attractors to fine
ones, so that branches carry to the rim before twigs fill in. Tan et al. 2008 stop at the limbs; a
leaf, however, must hang on a twig wherever the photo shows foliage.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow import kernels
from forestgen.tree.grow.aside import step_aside
from forestgen.tree.grow.crown_volume import CrownVolume
from forestgen.tree.grow.densify import densify
from forestgen.tree.grow.rising import Boughs, rising
from forestgen.tree.grow.sprays import grow_sprays
from forestgen.tree.grow.uncovered import uncovered_places
from forestgen.tree.skeleton import Skeleton, height_above_tips, main_child, n_children

STEP = 0.5  # of the attractors' spacing
REACHED = 0.55  # of the spacing: an attractor this near has its wood
INFLUENCE = 4.0  # of the spacing: how far an attractor pulls
BEND = np.deg2rad(18)  # at most, from one step to the next
CONE = np.deg2rad(50)  # ahead of a tip; what pulls from outside it raises a side shoot: no hooks
SWERVE = np.deg2rad(45)  # from how a shoot began; what pulls from outside it raises a side shoot too
SIDE = (np.deg2rad(38), np.deg2rad(68))  # between a side shoot and its bearer
SIDES = 2  # side shoots of a node, at most
INERTIA = 0.6  # of a shoot, against the pull of 1
LIFT = 0.12  # upward, against the pull of 1: light
WANDER = 0.12  # random, against the pull of 1
MAX_STEPS = 80
DENSE = 0.022  # of the height: nodes of limbs are no farther apart, so that twigs start all along them
SCALES = ((4, False), (4, True), (2, False), (1, False))  # spacings of the attractors; whether twigs may cross sky
NEAR_ENOUGH = 0.011  # of the height: foliage that has wood this near in the picture needs no more
COARSE = 0.03  # of the height: foliage farther from wood in the picture gets a spray before the finer twigs
FINE = 0.008  # and after them
ROUNDING = 2  # times that each new node is drawn between its neighbours
ELBOWS = 4  # likewise where shoots of several generations carry one bough on


@dataclass(eq=False)
class Shoots:
    """Nodes that may grow. N nodes; the first ones stand on the limbs."""

    position: NDArray[np.float64]  # (N, 3)
    parent: NDArray[np.int64]  # (N,)
    heading: NDArray[np.float64]  # (N, 3) unit, of the segment that leads to the node (of the axis, on a limb)
    begun: NDArray[np.float64]  # (N, 3) unit, as the shoot began that the node belongs to
    children: NDArray[np.int64]  # (N,)
    bears: NDArray[np.bool_]  # (N,) whether it may grow at all


def grow_twigs(
    skeleton: Skeleton,
    n_fixed: int,
    bare: NDArray[np.int64],
    volume: CrownVolume,
    spacing: float,
    *,
    boughs: Boughs | None = None,
    rng: np.random.Generator,
) -> Skeleton:
    """The tree with its last generations: a twig near each place in the crown, `spacing` metres apart.

    The first `n_fixed` nodes stay as they are (they are dense already); the nodes in `bare`, among
    these, bear no twigs. `boughs`, where the depth is open, says how steeply they are to rise.
    """
    position, parent = skeleton.position, skeleton.parent
    for scale, crosses in SCALES:
        target = volume.sample(scale * spacing, rng)
        where = volume.crossing() if crosses else volume
        position, parent = _extended(position, parent, n_fixed, bare, where, target, scale * spacing, rng=rng)
        if scale == SCALES[0][0] and boughs is not None:
            position, parent = rising(position, parent, n_fixed, boughs, volume, rng=rng)
        if crosses:
            position, parent = grow_sprays(position, parent, bare, volume, COARSE * volume.height, rng=rng)
    position = _rounded(position, parent, n_fixed, volume, ELBOWS)
    for camera, leafy in zip(volume.cameras, volume.leafy, strict=True):
        target = uncovered_places(camera, leafy, position, parent, NEAR_ENOUGH * volume.height)
        target = volume.into_masses(target)
        position, parent = _extended(position, parent, n_fixed, bare, volume, target, 0.5 * spacing, rng=rng)
    position, parent = step_aside(position, parent, n_fixed, volume)
    position, parent = grow_sprays(position, parent, bare, volume, FINE * volume.height, rng=rng)
    radius = np.concatenate([skeleton.radius[:n_fixed], np.full(len(parent) - n_fixed, np.nan)])
    return Skeleton(position, parent, radius)


def _extended(
    position: NDArray[np.float64],
    parent: NDArray[np.int64],
    n_fixed: int,
    bare: NDArray[np.int64],
    volume: CrownVolume,
    target: NDArray[np.float64],
    spacing: float,
    *,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Places and parents of a tree grown toward targets (S, 3) that lie `spacing` metres apart."""
    grown = Skeleton(position, parent, np.full(len(parent), np.nan))
    dense, _ = densify(grown, DENSE * volume.height)
    bears = np.ones(len(dense), bool)
    bears[bare] = False
    shoots = shoots_on(dense, bears)
    n_starts = len(dense)
    colonise(shoots, volume, target, spacing, rng=rng)
    place = _rounded(shoots.position, shoots.parent, n_starts, volume, ROUNDING)
    stays = without_bare_ends(shoots.parent, n_fixed, volume.allows(place)[1])
    index, kept = np.cumsum(stays) - 1, shoots.parent[stays]
    return place[stays], np.where(kept < 0, -1, index[kept])


def colonise(
    shoots: Shoots, volume: CrownVolume, target: NDArray[np.float64], spacing: float, *, rng: np.random.Generator
) -> None:
    """Grow shoots toward targets (S, 3) until each is reached or cannot be; metres."""
    open_ = np.ones(len(target), bool)
    away2 = np.full(len(target), np.inf)
    nearest = np.full(len(target), -1)
    usable = np.where(shoots.bears[:, None], shoots.position, np.inf)
    kernels.nearest_nodes(usable, 0, target, open_, away2, nearest)
    reach = INFLUENCE * spacing
    for _ in range(MAX_STEPS):
        open_ &= (away2 > (REACHED * spacing) ** 2) & (nearest >= 0)
        open_[open_] = shoots.bears[nearest[open_]]
        if not open_.any():
            return
        pulls = np.flatnonzero(open_ & (away2 <= reach**2))
        if not len(pulls):
            reach = 1.2 * float(np.sqrt(away2[open_].min()))
            continue
        pull = _unit(target[pulls] - shoots.position[nearest[pulls]])
        ahead = (pull * shoots.heading[nearest[pulls]]).sum(axis=1)
        kept = (pull * shoots.begun[nearest[pulls]]).sum(axis=1)
        is_side = (shoots.children[nearest[pulls]] > 0) | (ahead < np.cos(CONE)) | (kept < np.cos(SWERVE))
        pair, of = np.unique(2 * nearest[pulls] + is_side, return_inverse=True)
        node, side = pair // 2, pair % 2 > 0
        heading = _headings(shoots, node, side, of, pull, rng=rng)
        tip = shoots.position[node] + STEP * spacing * heading
        fits = volume.allows(tip)[0] & volume.spans(shoots.position[node], tip)
        before = away2[pulls]
        first = len(shoots.parent)
        _append(shoots, node[fits], tip[fits], heading[fits], side[fits])
        kernels.nearest_nodes(shoots.position, first, target, open_, away2, nearest)
        helped = np.zeros(len(node), bool)
        np.logical_or.at(helped, of, away2[pulls] < before)
        shoots.bears[node[~(fits & helped)]] = False


def _headings(
    shoots: Shoots,
    node: NDArray[np.int64],
    side: NDArray[np.bool_],
    of: NDArray[np.int64],
    pull: NDArray[np.float64],
    *,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Directions (G, 3) in which the nodes (G,) grow on or to the side, by unit pulls (E, 3), each on number `of`."""
    total = np.zeros((len(node), 3))
    np.add.at(total, of, pull)
    ahead = shoots.heading[node]
    wish = _unit(total) + WANDER * rng.normal(size=total.shape) + [0.0, LIFT, 0.0]
    wish += np.where(side, 0.0, INERTIA)[:, None] * ahead
    low, high = np.where(side[:, None], SIDE, (0.0, BEND)).T
    return turn_within(_unit(wish), ahead, low, high)


def turn_within(
    wish: NDArray[np.float64], axis: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The directions (G, 3) nearest to the wished ones whose angles to the axes (G, 3) lie in [low, high]."""
    cosine = np.clip((wish * axis).sum(axis=1), -1, 1)
    angle = np.clip(np.arccos(cosine), low, high)
    aside = wish - cosine[:, None] * axis
    spare = np.cross(axis, np.where(np.abs(axis[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 0, 1.0]]))
    aside = _unit(np.where(np.linalg.norm(aside, axis=1, keepdims=True) > 1e-6, aside, spare))
    return np.asarray(np.cos(angle)[:, None] * axis + np.sin(angle)[:, None] * aside)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12))


def _append(
    shoots: Shoots,
    node: NDArray[np.int64],
    tip: NDArray[np.float64],
    heading: NDArray[np.float64],
    side: NDArray[np.bool_],
) -> None:
    begun = np.where(side[:, None], heading, shoots.begun[node])
    shoots.begun = np.concatenate([shoots.begun, begun])
    shoots.children[node] += 1
    shoots.bears[node[shoots.children[node] > SIDES]] = False
    shoots.position = np.concatenate([shoots.position, tip])
    shoots.parent = np.concatenate([shoots.parent, node])
    shoots.heading = np.concatenate([shoots.heading, heading])
    shoots.children = np.concatenate([shoots.children, np.zeros(len(node), np.int64)])
    shoots.bears = np.concatenate([shoots.bears, np.ones(len(node), bool)])


def shoots_on(tree: Skeleton, bears: NDArray[np.bool_]) -> Shoots:
    """The nodes of a tree as starts of shoots, those of them that bear (N,)."""
    step = np.zeros_like(tree.position)
    step[1:] = tree.position[1:] - tree.position[tree.parent[1:]]
    step[0] = [0.0, 1.0, 0.0]
    children = n_children(tree.parent)
    heading = _unit(step)
    return Shoots(tree.position, tree.parent, heading, heading.copy(), children, bears & (children <= SIDES))


def _rounded(
    position: NDArray[np.float64], parent: NDArray[np.int64], first: int, volume: CrownVolume, rounds: int
) -> NDArray[np.float64]:
    """Places (N, 3) smoothed from node `first` on, where wood may pass there and shows no more than before."""
    place = smooth(position, parent, first, rounds)
    may = volume.allows(place)[0] & (volume.hidden(place) | ~volume.hidden(position))
    return np.where(may[:, None], place, position)


def smooth(position: NDArray[np.float64], parent: NDArray[np.int64], first: int, rounds: int) -> NDArray[np.float64]:
    """Places (N, 3) with the nodes from `first` on drawn between their neighbours on the way: no zigzag."""
    if len(parent) <= first:
        return position
    place = position.copy()
    child = main_child(height_above_tips(position, parent), parent)
    node = np.arange(first, len(parent))
    node = node[child[node] >= 0]
    for _ in range(rounds):
        place[node] = 0.5 * place[node] + 0.25 * (place[parent[node]] + place[child[node]])
    return place


def without_bare_ends(parent: NDArray[np.int64], first: int, may_end: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which nodes (N,) stay when those from `first` on that lead to no place where a twig may end are cut."""
    stays = may_end.copy()
    stays[:first] = True
    for node in range(len(parent) - 1, 0, -1):
        if stays[node]:
            stays[parent[node]] = True
    return stays
