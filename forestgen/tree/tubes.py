"""Tubes: closed triangle surfaces spanned between the rings of limbs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.frames import transport
from forestgen.tree.limbs import unit
from forestgen.tree.rings import Rings

SEAM = np.array([0.0, 0.0, -1.0])  # the texture's seam starts on the side away from the photo's camera
DOME = ((12, (0.5, 0.95)), (7, (0.7,)))  # a limb of so many sides ends in extra rings at these polar angles
POINTED = 1.3  # how far an end reaches beyond its last ring, in radii


@dataclass(frozen=True, eq=False)
class Tubes:
    """P vertices, F faces, L limbs. The first and last vertex of a ring lie on the same spot."""

    points: NDArray[np.float64]  # (P, 3) m
    outward: NDArray[np.float64]  # (P, 3) unit, away from the limb's axis
    angle: NDArray[np.float64]  # (P,) around the limb, 0 to 2 pi
    radius: NDArray[np.float64]  # (P,) m, distance from the axis
    ring: NDArray[np.int64]  # (P,) index of the ring that the vertex stands on
    limb: NDArray[np.int64]  # (P,)
    weld: NDArray[np.int64]  # (P,) the vertex that stands for all on the same spot
    faces: NDArray[np.int64]  # (F, 3)
    is_base: NDArray[np.bool_]  # (F,) whether the face closes the base of a limb, inside its parent

    def __post_init__(self) -> None:
        freeze(
            self,
            points=(np.float64, "P", 3),
            outward=(np.float64, "P", 3),
            angle=(np.float64, "P"),
            radius=(np.float64, "P"),
            ring=(np.int64, "P"),
            limb=(np.int64, "P"),
            weld=(np.int64, "P"),
            faces=(np.int64, "F", 3),
            is_base=(np.bool_, "F"),
        )


def with_domes(rings: Rings, sides: NDArray[np.int64]) -> Rings:
    """Close the ends: a last ring of radius 0 each, and rounding ones before it on thick limbs."""
    n_extra = np.ones(len(sides), np.int64)
    for least, angles in DOME[::-1]:
        n_extra[sides >= least] = 1 + len(angles)
    last = rings.first[1:] - 1
    source = np.repeat(last, n_extra)
    limb = np.repeat(np.arange(len(sides)), n_extra)
    rank = np.arange(len(source)) - np.repeat(np.cumsum(n_extra) - n_extra, n_extra)
    polar = np.full(len(source), np.pi / 2)
    for least, angles in DOME[::-1]:
        for k, angle in enumerate(angles):
            polar[(sides[limb] >= least) & (rank == k)] = angle
            polar[(sides[limb] >= least) & (rank > k)] = np.pi / 2
    reach = POINTED * np.sin(polar) * rings.radius[source]
    where = np.repeat(rings.first[1:], n_extra)
    ahead = rings.tangent[source]
    width = np.where(polar < np.pi / 2, np.cos(polar) * rings.radius[source], 0.0)
    return Rings(
        first=rings.first + np.concatenate([[0], np.cumsum(n_extra)]),
        station=np.insert(rings.station, where, rings.station[source] + reach),
        centre=np.insert(rings.centre, where, rings.centre[source] + reach[:, None] * ahead, axis=0),
        tangent=np.insert(rings.tangent, where, ahead, axis=0),
        radius=np.insert(rings.radius, where, width),
    )


def sweep(rings: Rings, sides: NDArray[np.int64]) -> Tubes:
    """Span a closed tube of `sides` (L,) flats between the rings of each limb.

    The last ring of a limb has radius 0 (see `with_domes`): one vertex, the tip.
    """
    limb = rings.limb
    is_last = np.zeros(len(limb), bool)
    is_last[rings.first[1:] - 1] = True
    n_side = sides[limb]
    count = np.where(is_last, 1, n_side + 1)
    offset = np.cumsum(count) - count
    ring = np.repeat(np.arange(len(limb)), count)
    side = np.arange(len(ring)) - offset[ring]
    closes = (side == n_side[ring]) & ~is_last[ring]
    angle = 2 * np.pi * side / n_side[ring]
    normal = transport(rings.centre, rings.tangent, rings.first, SEAM)
    binormal = np.cross(rings.tangent, normal)
    turn = np.where(closes, 0.0, angle)[:, None]  # exactly the same spot as side 0
    outward = np.cos(turn) * normal[ring] + np.sin(turn) * binormal[ring]
    outward[is_last[ring]] = rings.tangent[is_last]
    return Tubes(
        points=rings.centre[ring] + rings.radius[ring, None] * outward,
        outward=outward,
        angle=angle,
        radius=rings.radius[ring],
        ring=ring,
        limb=limb[ring],
        weld=np.where(closes, offset[ring], np.arange(len(ring))),
        faces=(faces := tube_faces(rings.first, offset, n_side))[0],
        is_base=faces[1],
    )


def tube_faces(
    first: NDArray[np.int64], offset: NDArray[np.int64], n_side: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Faces (F, 3), outward anticlockwise, and whether each closes a base (F,).

    Rings (R,) start at vertices `offset` and have `n_side` flats; `first` (L + 1,) bounds the limbs.
    """
    tip, base = first[1:] - 1, first[:-1]
    lower = np.delete(np.arange(len(offset)), np.concatenate([tip, tip - 1]))
    a, j = each_side(lower, n_side[lower])
    near, far = offset[a] + j, offset[a + 1] + j
    walls = np.stack([near, near + 1, far + 1, near, far + 1, far], axis=1).reshape(-1, 3)
    a, j = each_side(tip - 1, n_side[tip])
    cones = np.stack([offset[a] + j, offset[a] + j + 1, offset[a + 1]], axis=1)
    a, j = each_side(base, n_side[base] - 2)
    floors = np.stack([offset[a], offset[a] + j + 2, offset[a] + j + 1], axis=1)
    # the closing wall ends on the doubled seam vertex; the floor never touches it
    faces = np.concatenate([walls, cones, floors])
    return faces, np.arange(len(faces)) >= len(walls) + len(cones)


def each_side(ring: NDArray[np.int64], n: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Each ring (A,) repeated n (A,) times, and the count 0 .. n - 1 beside it."""
    owner = np.repeat(np.arange(len(ring)), n)
    return ring[owner], np.arange(len(owner)) - (np.cumsum(n) - n)[owner]


def vertex_normals(tubes: Tubes, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Smooth unit normals (P, 3) for the tubes' vertices at places (P, 3), by the faces' areas."""
    faces = tubes.weld[tubes.faces[~tubes.is_base]]
    a, b, c = (points[faces[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    total = np.zeros_like(points)
    for axis in range(3):
        weight = np.repeat(area[:, axis], 3)
        total[:, axis] = np.bincount(faces.ravel(), weight, minlength=len(points))
    normal = unit(total)
    lost = np.linalg.norm(total, axis=1) < 1e-30
    normal[lost] = tubes.outward[lost]
    return normal[tubes.weld]
