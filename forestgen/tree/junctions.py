"""Junctions: a limb grows out of its parent with a fillet, as if both were one piece of wood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.limb_curves import LimbCurves
from forestgen.tree.limbs import unit

PIECES = 12  # straight pieces that stand for the parent around the junction
WINDOW = 4.0  # how far they reach to either side, in parent radii
PROBES = 24  # points of a child's axis at which it is asked whether it has left the parent
N_RINGS = 12  # rings over the stretch where the child comes out


@dataclass(frozen=True, eq=False)
class Sockets:
    """J junctions with a fillet: the parent's axis around each, and its radius there."""

    limb: NDArray[np.int64]  # (J,) the child
    axis: NDArray[np.float64]  # (J, PIECES + 1, 3) m
    radius: NDArray[np.float64]  # (J, PIECES + 1) m
    size: NDArray[np.float64]  # (J,) m, radius of the fillet

    def __post_init__(self) -> None:
        freeze(
            self,
            limb=(np.int64, "J"),
            axis=(np.float64, "J", PIECES + 1, 3),
            radius=(np.float64, "J", PIECES + 1),
            size=(np.float64, "J"),
        )


def sockets(curves: LimbCurves, limb: NDArray[np.int64], collar: float) -> Sockets:
    """The surroundings of the bases of limbs (J,); fillets of `collar` times the child's radius."""
    limbs = curves.limbs
    base, stem = limbs.socket[limb], limbs.parent[limb]
    reach = WINDOW * curves.radius[base]
    station = curves.knot_station[base][:, None] + reach[:, None] * np.linspace(-1, 1, PIECES + 1)
    station = np.clip(station, curves.begin[stem][:, None], curves.end[stem][:, None])
    flat = station.ravel()
    return Sockets(
        limb=limb,
        axis=curves.at(flat).reshape(*station.shape, 3),
        radius=curves.radius_at(flat).reshape(station.shape),
        size=collar * curves.radius[limbs.first[limb]],
    )


def height_over(
    here: Sockets, junction: NDArray[np.int64], points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Height (Q,) m of points (Q, 3) over the parent's surface at junctions (Q,), negative inside,
    and the surface's unit normal (Q, 3) under them."""
    height = np.full(len(points), np.inf)
    foot = np.zeros_like(points)
    for k in range(PIECES):
        a, chord = here.axis[junction, k], (here.axis[:, k + 1] - here.axis[:, k])[junction]
        square = np.sum(chord * chord, axis=1)
        t = np.clip(np.sum((points - a) * chord, axis=1) / np.where(square > 0, square, 1), 0, 1)
        nearest = a + t[:, None] * chord
        wide = (1 - t) * here.radius[junction, k] + t * here.radius[junction, k + 1]
        over = np.linalg.norm(points - nearest, axis=1) - wide
        closer = over < height
        height[closer] = over[closer]
        foot[closer] = nearest[closer]
    return height, unit(points - foot)


def collar_stations(curves: LimbCurves, here: Sockets) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Stations (Z,) that resolve each fillet, from where the child begins to show, and their limbs."""
    begin = curves.begin[here.limb]
    radius = curves.radius[curves.limbs.first[here.limb]]
    far = np.minimum(curves.end[here.limb] - begin, WINDOW * here.radius.max(axis=1) + 2 * radius)
    probe = begin[:, None] + far[:, None] * np.linspace(0, 1, PROBES)
    junction = np.repeat(np.arange(len(begin)), PROBES)
    height, _ = height_over(here, junction, curves.at(probe.ravel()))
    height = height.reshape(probe.shape)
    shows = np.argmax(height + radius[:, None] > 0, axis=1)
    is_out = height - radius[:, None] > here.size[:, None]
    clear = np.where(is_out.any(axis=1), np.argmax(is_out, axis=1), PROBES - 1)
    row = np.arange(len(begin))
    low, high = probe[row, np.maximum(shows - 1, 0)], probe[row, clear]
    low = np.maximum(low, begin + 0.02 * far)
    station = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, N_RINGS)
    return station.ravel(), np.repeat(here.limb, N_RINGS)


def fillet(
    here: Sockets, junction: NDArray[np.int64], points: NDArray[np.float64], outward: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Where the child's surface points (Q, 3), with `outward` (Q, 3) off its axis, go to meet the parent softly.

    A ball of the fillet's size rolled along both surfaces widens the child: not at all at the
    ball's height over the parent, by its whole radius at the parent's surface, less again inside.
    Where the child's surface faces the same way as the parent's they run into one another without.
    The points spread along the parent's surface and keep their height over it, so that no ledge rises.
    """
    height, normal = height_over(here, junction, points)
    size = here.size[junction]
    x = np.clip(height / size, -1, 1)
    rolled = np.where(x >= 0, 1 - np.sqrt(1 - (1 - np.maximum(x, 0)) ** 2), 1 + x)
    facing = np.sum(normal * outward, axis=1)
    along = outward - np.maximum(facing, 0)[:, None] * normal
    spread = points + (size * rolled * np.clip(1 - facing, 0, 1))[:, None] * along
    moved = np.flatnonzero(rolled > 0)
    risen, under = height_over(here, junction[moved], spread[moved])
    spread[moved] -= np.maximum(risen - height[moved], 0)[:, None] * under
    return np.asarray(spread)


def blend_normals(
    here: Sockets, junction: NDArray[np.int64], points: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Turn the child's normals (Q, 3) towards the parent's where its points (Q, 3) touch the parent."""
    height, stem = height_over(here, junction, points)
    x = np.clip(1 - height / (0.6 * here.size[junction]), 0, 1)
    weight = x * x * (3 - 2 * x)
    return unit((1 - weight)[:, None] * normal + weight[:, None] * stem)
