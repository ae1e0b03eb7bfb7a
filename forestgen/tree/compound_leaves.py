"""Compound leaves: several leaflets arranged on a small twig, in pairs or as a fan (Neubert et al. 2007, sec. 9.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.foliage_poses import unit
from forestgen.tree.foliage_twigs import across
from forestgen.tree.skeleton import Skeleton, n_children

PAIR_ANGLE = np.deg2rad(55)  # between rachis and the leaflets of a pair
FAN = np.deg2rad(75)  # between the twig's end and the outermost leaflet of a fan
UNEVEN = np.deg2rad(8)  # standard deviation of both
DROOP = 0.15  # of a leaflet's direction, downward
OUTER = 0.8  # length of the outermost leaflets of a fan, over the middle one's


@dataclass(frozen=True, eq=False)
class Leaflets:
    """Leaflets on twig ends. L leaflets."""

    foot: NDArray[np.float64]  # (L, 3) m, on the bark
    axis: NDArray[np.float64]  # (L, 3) unit
    face: NDArray[np.float64]  # (L, 3) unit, across the compound leaf's own plane, upward
    share: NDArray[np.float64]  # (L,) length over that of the largest leaflet

    def __len__(self) -> int:
        return len(self.share)


def pinnate(
    skeleton: Skeleton, tips: NDArray[np.int64], count: int, length: float, *, rng: np.random.Generator
) -> Leaflets:
    """Leaflets in pairs along the last `length` metres before tips (T,), and one at the end if `count` is odd."""
    pairs = count // 2
    back = length * (np.arange(pairs) + 0.5 * (count % 2 + 1)) / max(pairs, 1)
    back = np.concatenate([np.zeros(count % 2), np.repeat(np.minimum(back, length), 2)])
    side = np.concatenate([np.zeros(count % 2), np.tile([-1.0, 1.0], pairs)])
    foot, twig, radius = points_before(skeleton, np.repeat(tips, count), np.tile(back, len(tips)))
    turn = np.tile(side, len(tips)) * PAIR_ANGLE + rng.normal(0, UNEVEN, len(foot))
    return _leaflets(foot, twig, radius, turn, np.ones(len(foot)))


def palmate(skeleton: Skeleton, tips: NDArray[np.int64], count: int, *, rng: np.random.Generator) -> Leaflets:
    """Leaflets as a fan at the tips (T,)."""
    spread = np.linspace(-1, 1, count) if count > 1 else np.zeros(1)
    foot, twig, radius = points_before(skeleton, np.repeat(tips, count), np.zeros(len(tips) * count))
    turn = np.tile(spread, len(tips)) * FAN + rng.normal(0, UNEVEN, len(foot))
    return _leaflets(foot, twig, radius, turn, np.tile(1 - (1 - OUTER) * np.abs(spread), len(tips)))


def points_before(
    skeleton: Skeleton, tips: NDArray[np.int64], back: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Places (L, 3) on the way to each of the tips (L,), `back` (L,) metres before it, unit directions and radii.

    A way ends at the fork before the tip: what lies farther back belongs to another twig.
    """
    parent, children = skeleton.parent, n_children(skeleton.parent)
    node, left = tips.copy(), back.astype(np.float64)
    while True:
        above = np.maximum(parent[node], 0)
        step = np.linalg.norm(skeleton.position[node] - skeleton.position[above], axis=1)
        goes_on = (left > step) & (above > 0) & (children[above] == 1)
        if not goes_on.any():
            break
        left = np.where(goes_on, left - step, left)
        node = np.where(goes_on, above, node)
    share = np.clip(left / np.maximum(step, 1e-12), 0, 1)[:, None]
    way = skeleton.position[node] - skeleton.position[above]
    radius = np.nan_to_num(skeleton.radius[node])
    return skeleton.position[node] - share * way, unit(way), radius


def _leaflets(
    foot: NDArray[np.float64],
    twig: NDArray[np.float64],
    radius: NDArray[np.float64],
    turn: NDArray[np.float64],
    share: NDArray[np.float64],
) -> Leaflets:
    """Leaflets turned by angles (L,) off their twigs (L, 3), in the plane that lies most nearly level."""
    side, face = across(twig)
    face = face * np.where(face[:, 1:2] < 0, -1.0, 1.0)
    axis = np.cos(turn)[:, None] * twig + np.sin(turn)[:, None] * side
    outward = np.sign(turn)[:, None] * side * (np.abs(turn) > 0.3)[:, None]
    axis = unit(axis - [0.0, DROOP, 0.0])
    return Leaflets(foot + 0.9 * radius[:, None] * outward, axis, face, share)
