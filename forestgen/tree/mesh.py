"""Mesh stage: a skeleton with radii becomes branches with a closed, textured surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.junctions import Sockets, blend_normals, collar_stations, fillet, sockets
from forestgen.tree.limb_curves import LimbCurves, curve_through, relaxed
from forestgen.tree.limbs import (
    Limbs,
    limbs_along,
    merge_coincident,
    plant,
    thickest_child,
    tree_size,
    without_hairpins,
)
from forestgen.tree.model import Bark, Mesh
from forestgen.tree.rings import Rings, needed_stations, place_rings, with_zones
from forestgen.tree.root_flare import flare_stations, flared, remaining_flare
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import Strategy
from forestgen.tree.tubes import Tubes, sweep, vertex_normals, with_domes

SMALLEST = 1e-4  # radius of wood without thickness, and below which rings get no denser, as a share of the tree's size
THREAD = 2e-5  # radius below which a twig is not drawn thinner
ROUGH_SIDES = 10  # limbs with that many sides show the wood's unevenness in full
FILLET_SIDES = 5  # thinner limbs join without a fillet: it would be smaller than a pixel
TAPER = 6.0  # radii of way over which a tip of the tree narrows
GOLDEN = 0.6180339887498949  # limbs start at different places around the bark


@dataclass(frozen=True, kw_only=True)
class GeneralisedCylinders(Strategy):
    """Sweep a round section along each limb (Bloomenthal 1985, "Modeling the mighty maple").

    Tan et al. 2008 give branches "a generalised cylinder" without figures, so none of these
    defaults is printed: they were chosen so that a tree seen as large as the photo shows no
    corners. Shares are of the tree's size, the diagonal of its box.
    """

    max_sides: int = 18  # of a thick trunk
    min_sides: int = 3  # of a twig
    roundness: float = 3.5e-4  # how far a flat side may lie inside the true circle, share of the size
    straightness: float = 5e-4  # how far the axis may stray from its curve between rings, share of the size
    shift: float = 0.25  # how far smoothing may move a node, in radii (and at most `bow`)
    stride: float = 0.0  # taper needs no rings nearer together than this, share of the size; 0: by radii alone
    bow: float = 1e-3  # how far a curve may stray from the straight line between nodes, share of the size
    collar: float = 0.8  # radius of the fillet at a junction, in radii of the child
    lean: float = 0.8  # how much a branch as thick as its parent leaves in the parent's direction
    tip: float = 0.35  # radius at the end of a limb, as a share of its base; thinner ends stay
    flare: float = 0.2  # widening of the trunk at the ground, as a share of its radius
    sink: float = 0.15  # how far the trunk reaches into the ground, in its radii
    roughness: float = 0.05  # unevenness of thick limbs, in radii

    def __call__(self, skeleton: Skeleton, bark: Bark) -> Mesh:
        """The branch mesh of a skeleton whose radii are all known.

        Raises:
            ValueError: a radius is NaN or negative.
        """
        if not np.all(skeleton.radius >= 0):
            raise ValueError("GeneralisedCylinders: a radius is NaN or negative; run the radius stage first")
        merged = merge_coincident(skeleton)
        size = tree_size(merged.position) or max(float(merged.radius[0]), 1e-3)
        sink = max(self.sink * float(merged.radius[0]), 1e-3 * size)
        curves = self.smooth_paths(plant(merged, sink), size)
        sides = self.sides(curves, size)
        joints = sockets(curves, joined_limbs(curves.limbs, sides), self.collar)
        rings = with_domes(self.rings(curves, joints, sides, size, sink), sides)
        tubes = sweep(rings, sides)
        points = self.shape(tubes, curves, joints, sides, sink)
        normals = joined_normals(tubes, joints, points)
        return Mesh(points, normals, bark_uv(rings, tubes, curves, sides, bark), tubes.faces)

    def smooth_paths(self, skeleton: Skeleton, size: float) -> LimbCurves:
        """The limbs of a planted skeleton of the given size (m) as smooth curves with radii."""
        bow = self.bow * size
        limit = np.minimum(self.shift * skeleton.radius, bow)
        continues = thickest_child(skeleton)
        position, radius = relaxed(skeleton, continues, limit)
        even = Skeleton(position, skeleton.parent, radius)
        limbs = limbs_along(even, without_hairpins(even, continues))
        own = limb_radii(limbs, position, radius, self.tip)
        knot_radius = np.maximum(own, np.where(own > 0, THREAD, SMALLEST) * size)
        ratio = knot_radius[limbs.first[:-1]] / np.maximum(knot_radius[limbs.socket], SMALLEST * size)
        room = bow + 0.5 * knot_radius
        return curve_through(limbs, position[limbs.node], knot_radius, self.lean * np.clip(ratio, 0, 1), room)

    def sides(self, curves: LimbCurves, size: float) -> NDArray[np.int64]:
        """Number of flats (L,) around each limb of a tree of the given size (m)."""
        return self.flats(np.maximum.reduceat(curves.radius, curves.limbs.first[:-1]), size)

    def flats(self, thickest: NDArray[np.float64], size: float) -> NDArray[np.int64]:
        """Number of flats (L,) around limbs as thick as (L,) m: n of them fall short of the circle by
        r (1 - cos(pi/n))."""
        inside = np.clip(self.roundness * size / thickest, 1e-9, 1.0)
        n = np.ceil(np.pi / np.arccos(1 - inside))
        return np.asarray(np.clip(n, self.min_sides, self.max_sides), np.int64)

    def rings(self, curves: LimbCurves, joints: Sockets, sides: NDArray[np.int64], size: float, sink: float) -> Rings:
        """Cross-sections where bends, taper, junctions and the root's flare need them."""
        n_side = sides[curves.limbs.limb]
        far = np.where(n_side > self.min_sides, np.where(n_side >= ROUGH_SIDES, 1.5, 6.0), 60.0)
        thick = np.maximum(curves.radius, SMALLEST * size)
        tolerance = np.maximum(self.straightness * size, np.where(n_side > self.min_sides, 0.03, 0.7) * thick)
        station, limb = needed_stations(curves, tolerance, np.maximum(far * thick, self.stride * size))
        foot = flare_stations(float(curves.begin[0]), sink, float(curves.radius[0]))
        collar, owner = collar_stations(curves, joints)
        zones, owners = np.concatenate([foot, collar]), np.concatenate([np.zeros(len(foot), np.int64), owner])
        station, limb = with_zones(station, limb, zones, owners, curves)
        return place_rings(curves, station, limb, 1 + 2 * self.roughness, THREAD * size)

    def shape(
        self, tubes: Tubes, curves: LimbCurves, joints: Sockets, sides: NDArray[np.int64], sink: float
    ) -> NDArray[np.float64]:
        """The tubes' vertices (P, 3) with the root's flare, the fillets and the wood's unevenness."""
        base = curves.radius[curves.limbs.first[:-1]]
        amount = self.roughness * np.clip((sides - ROUGH_SIDES / 2) / (ROUGH_SIDES / 2), 0, 1)
        widen = 1 + amount[tubes.limb] * unevenness(tubes.points / (3 * base[tubes.limb, None]))
        trunk = tubes.limb == 0
        ground = float(curves.position[0, 1]) + sink
        above = float(curves.radius_at(curves.begin[:1] + 4 * base[0])[0])
        flare = remaining_flare(self.flare, float(base[0]), above)
        widen[trunk] *= flared(tubes.points[trunk, 1] - ground, tubes.angle[trunk], float(base[0]), flare)
        points = np.asarray(tubes.points + (tubes.radius * (widen - 1))[:, None] * tubes.outward, np.float64)
        at, junction = near_sockets(tubes, joints)
        points[at] = fillet(joints, junction, points[at], tubes.outward[at])
        return points


def joined_limbs(limbs: Limbs, sides: NDArray[np.int64]) -> NDArray[np.int64]:
    """The side limbs (J,) that get a fillet."""
    return np.flatnonzero((limbs.parent >= 0) & (sides >= FILLET_SIDES))


def limb_radii(
    limbs: Limbs, position: NDArray[np.float64], radius: NDArray[np.float64], tip: float
) -> NDArray[np.float64]:
    """Radius (K,) of each limb at its knots, from places (N, 3) and radii (N,) of the nodes.

    A side limb starts as thick as its own first node, never quite as thick as its parent. Towards
    a tip of the tree the last TAPER radii of way narrow to the share `tip`.
    """
    own = radius[limbs.node]
    base, last = limbs.first[:-1], limbs.first[1:] - 1
    side = limbs.parent >= 0
    own[base[side]] = np.minimum(own[base[side] + 1], 0.92 * own[base[side]])
    point = position[limbs.node]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(point, axis=0), axis=1))])
    to_end = (way[last][limbs.limb] - way) / (TAPER * np.maximum(own, 1e-300))
    narrowing = tip + (1 - tip) * np.clip(to_end, 0, 1)
    end = own[last][limbs.limb]
    thin = np.maximum(np.minimum(narrowing * own, own), 0)
    return np.asarray(np.where(limbs.is_tip[limbs.limb] & (end > tip * own[base][limbs.limb]), thin, own))


def near_sockets(tubes: Tubes, joints: Sockets) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Vertices (Q,) of limbs with a fillet, and the junction (Q,) of each."""
    junction_of = np.full(int(tubes.limb.max()) + 1, -1)
    junction_of[joints.limb] = np.arange(len(joints.limb))
    at = np.flatnonzero((junction_of[tubes.limb] >= 0) & (tubes.radius > 0))
    return at, junction_of[tubes.limb[at]]


def unevenness(point: NDArray[np.float64]) -> NDArray[np.float64]:
    """A smooth function of place (P, 3), about -1 to 1, with bumps about one unit wide."""
    x, y, z = point.T
    first = np.sin(2.1 * x + 1.3 * y - 1.7 * z + 1.4 * np.sin(1.9 * y + 1.1 * z))
    second = np.sin(-1.2 * x + 2.3 * y + 1.9 * z + 1.4 * np.sin(2.2 * x - 0.7 * y))
    return np.asarray((first + second) / 2)


def joined_normals(tubes: Tubes, joints: Sockets, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normals (P, 3) of the shaped vertices (P, 3), running on from limb to limb at the fillets."""
    normal = vertex_normals(tubes, points)
    at, junction = near_sockets(tubes, joints)
    normal[at] = blend_normals(joints, junction, points[at], normal[at])
    return normal


def bark_uv(
    rings: Rings, tubes: Tubes, curves: LimbCurves, sides: NDArray[np.int64], bark: Bark
) -> NDArray[np.float64]:
    """Texture coordinates (P, 2) in repeats of the bark.

    u goes a whole number of times around; v grows along the limb as fast as u does across, so that
    nothing is stretched, and goes on from where the parent's stands at the junction.
    """
    limb, limbs = rings.limb, curves.limbs
    base = curves.radius[limbs.first[:-1]]
    repeats = np.maximum(1, np.round(2 * np.pi * base / bark.width_m))
    shrink = np.clip(2 * np.pi * rings.radius / (repeats[limb] * bark.width_m), 0.15, 2.0)
    step = np.diff(rings.station, prepend=rings.station[0])
    step[rings.first[:-1]] = 0
    mean_shrink = (shrink + np.roll(shrink, 1)) / 2
    run = np.cumsum(step / (mean_shrink * bark.height_m))
    run -= run[rings.first[:-1]][limb]
    start = np.zeros(len(limbs))
    at_socket = np.interp(curves.knot_station[limbs.socket], rings.station, run)
    for child in np.flatnonzero(limbs.parent >= 0):  # parents come first
        start[child] = start[limbs.parent[child]] + at_socket[child]
    u = tubes.angle / (2 * np.pi) * repeats[tubes.limb] + np.modf(GOLDEN * tubes.limb)[0]
    tip = tubes.radius == 0
    u[tip] += repeats[tubes.limb[tip]] / 2
    return np.column_stack([u, start[tubes.limb] + run[tubes.ring]])
