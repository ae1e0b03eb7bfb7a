"""Rising: boughs that run along the line of sight rise as those do that the photo shows from the side.

The photo shows such a bough as a point; growth, which heeds nothing else, would let it run dead level.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow.crown_volume import CrownVolume
from forestgen.tree.skeleton import height_above_tips, last_tip, main_child

ALONG = np.tan(np.deg2rad(35))  # of its way to or from the camera, that a bough along the line of sight goes sideways
UNEVEN = 0.12  # standard deviation of the rise over the reach from bough to bough
ARCH = 0.4  # steeper at the foot than on the whole, and as much flatter at the tip
SHARES = (1.0, 0.75, 0.5, 0.25)  # of the rise, the most that the photo has room for
ROOM = 0.9  # of a bough's own nodes must have room, as they had before
LONG = 0.06  # of the height: shorter twigs stay


@dataclass(frozen=True, eq=False)
class Boughs:
    """How steep boughs are that the photo shows from the side."""

    stem: NDArray[np.int64]  # (P,) the nodes that bear them
    slope: float  # rise over reach


def rising(
    position: NDArray[np.float64],
    parent: NDArray[np.int64],
    n_fixed: int,
    boughs: Boughs,
    volume: CrownVolume,
    *,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Places and parents of a tree (N,) whose boughs, with all they bear, rise as steeply as those that are seen.

    The first `n_fixed` nodes stay, and boughs that do not run along the line of sight, rise enough, or have no
    room in the picture. What a bough bears is cut where it now lies over a gap that it did not lie over before.
    """
    camera = volume.cameras[0]
    bough = _boughs(position, parent, n_fixed, boughs.stem)
    tip = last_tip(main_child(height_above_tips(position, parent), parent))
    place, stays = position.copy(), np.ones(len(parent), bool)
    for first in np.unique(bough[bough >= 0]).tolist():
        foot = position[parent[first]]
        way = camera.axes @ (position[tip[first]] - foot)
        reach = float(np.hypot(way[0], way[2]))
        wanted = (boughs.slope + UNEVEN * rng.normal()) * reach - way[1]
        if reach < LONG * volume.height or abs(way[0]) > ALONG * abs(way[2]) or wanted <= 0:
            continue
        nodes = np.flatnonzero(bough == first)
        main = tip[nodes] == tip[first]
        out = np.clip((position[nodes] - foot) @ (way[[0, 2]] @ camera.axes[[0, 2]]) / reach**2, 0, 1.2)
        lift = (wanted * out * (1 + ARCH * (1 - out)))[:, None] * camera.axes[1]
        had_room = volume.hidden(position[nodes])
        for share in SHARES:
            raised = position[nodes] + share * lift
            has_room = volume.hidden(raised)
            if has_room[main].mean() >= ROOM * had_room[main].mean():
                place[nodes] = raised
                stays[nodes] = main | has_room | ~had_room
                break
    for node in np.flatnonzero(parent >= 0).tolist():
        stays[node] &= stays[parent[node]]
    return place[stays], np.where(parent[stays] < 0, -1, (np.cumsum(stays) - 1)[parent[stays]])


def _boughs(
    position: NDArray[np.float64], parent: NDArray[np.int64], n_fixed: int, stem: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The first node (N,) of the bough on the stem that each node belongs to, -1 where it belongs to none."""
    is_stem = np.zeros(len(parent), bool)
    is_stem[stem] = True
    bough = np.full(len(parent), -1)
    for node in range(n_fixed, len(parent)):
        above = parent[node]
        if not is_stem[node]:
            bough[node] = node if is_stem[above] else bough[above]
    return bough
