"""What of a tree's wood stays solid beside its cards, as coarse tubes, and what goes onto them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.frames import mitre_tangents
from forestgen.tree.limbs import limbs_along, merge_coincident, plant, thickest_child
from forestgen.tree.model import Bark, Mesh, TreeModel
from forestgen.tree.rings import Rings
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.tubes import Tubes, sweep, vertex_normals, with_domes

THICK = 1 / 240  # radius above which wood is solid, as a share of the height: half a pixel wide at 60 px
TRUNK_SIDES, SIDES = 8, 4  # flats of the tubes
STRAIGHT = 1 / 600  # how far a tube's axis may stray from the limb, as a share of the height
MOST_FACES = 200  # of all tubes; limbs that are too many go onto the cards, the thinnest first
SINK = 1 / 200  # how far the trunk reaches into the ground, as a share of the height
COARSER = 1.15  # the step by which the least radius grows
REACH = 1.5  # radii from its axis within which a surface is a limb's own: roots flare, bark is uneven


def thick_skeleton(model: TreeModel) -> Skeleton:
    """The part of a tree's skeleton that stays solid, planted in the ground; always its first limb."""
    skeleton = merge_coincident(model.skeleton)
    least = THICK * model.height
    while True:
        thick = plant(_above(skeleton, least), SINK * model.height)
        first, _ = _polylines(thick, STRAIGHT * model.height)
        if len(first) == 2 or _n_faces(first) <= MOST_FACES:
            return thick
        least *= COARSER


def thin_faces(model: TreeModel, thick: Skeleton) -> NDArray[np.int64]:
    """Faces (T,) of the tree's mesh that are not the surface of its thick skeleton."""
    from scipy.spatial import cKDTree

    start, end = thick.position[thick.parent[1:]], thick.position[1:]
    radius = np.maximum(thick.radius[1:], thick.radius[thick.parent[1:]])
    n = 2 + np.ceil(np.linalg.norm(end - start, axis=1) / np.maximum(radius / 2, 1e-3 * model.height)).astype(np.int64)
    edge = np.repeat(np.arange(len(n)), n)
    t = ((np.arange(len(edge)) - np.repeat(np.cumsum(n) - n, n)) / (n - 1)[edge])[:, None]
    axis = cKDTree(start[edge] * (1 - t) + end[edge] * t)
    away, nearest = axis.query(model.mesh.points[model.mesh.faces].mean(axis=1))
    return np.flatnonzero(away > REACH * radius[edge[nearest]])


def coarse_wood(model: TreeModel, thick: Skeleton) -> Mesh:
    """The thick skeleton as tubes of few flats, seen from all sides as wide on average as round ones."""
    first, node = _polylines(thick, STRAIGHT * model.height)
    sides = _sides(first)
    limb = np.repeat(np.arange(len(sides)), np.diff(first))
    radius = thick.radius[node]
    side_base = first[1:-1]  # a side limb starts as thick as its own first node, not as its parent
    radius[side_base] = np.minimum(radius[side_base], radius[side_base + 1])
    centre = thick.position[node]
    step = np.linalg.norm(np.diff(centre, axis=0, prepend=centre[:1]), axis=1)
    flat = np.pi / sides[limb]
    rings = Rings(first, np.cumsum(step), centre, mitre_tangents(centre, first), radius * flat / np.sin(flat))
    rings = with_domes(rings, sides)
    tubes = sweep(rings, sides)
    uv = _bark_uv(tubes, rings, model.bark)
    return Mesh(tubes.points, vertex_normals(tubes, tubes.points), uv, tubes.faces)


def _above(skeleton: Skeleton, least: float) -> Skeleton:
    """The nodes that are reached from the root over wood of at least that radius."""
    keeps, parent = (skeleton.radius >= least).tolist(), skeleton.parent.tolist()
    keeps[0] = True
    for node in range(1, len(parent)):
        keeps[node] = keeps[node] and keeps[parent[node]]
    chosen = np.array(keeps)
    above = (np.cumsum(chosen) - 1)[skeleton.parent[chosen]]
    above[0] = -1
    return Skeleton(skeleton.position[chosen], above, skeleton.radius[chosen])


def _polylines(thick: Skeleton, tolerance: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Bounds (L + 1,) and nodes (K,) of its limbs, trunk first, with no more knots than `tolerance` metres ask for."""
    limbs = limbs_along(thick, thickest_child(thick))
    kept = [
        limbs.node[start:end][corners(thick.position[limbs.node[start:end]], tolerance)]
        for start, end in zip(limbs.first[:-1], limbs.first[1:], strict=True)
    ]
    return np.cumsum([0, *map(len, kept)]), np.concatenate(kept)


def corners(points: NDArray[np.float64], tolerance: float) -> NDArray[np.int64]:
    """Points of a polyline (N, 3) that keep it within `tolerance` (Douglas and Peucker 1973); first and last stay."""
    kept, open_parts = {0, len(points) - 1}, [(0, len(points) - 1)]
    while open_parts:
        start, end = open_parts.pop()
        if end - start < 2:
            continue
        chord, inner = points[end] - points[start], points[start + 1 : end] - points[start]
        t = np.clip(inner @ chord / max(float(chord @ chord), 1e-30), 0, 1)
        away = np.linalg.norm(inner - t[:, None] * chord, axis=1)
        farthest = int(away.argmax())
        if away[farthest] > tolerance:
            middle = start + 1 + farthest
            kept.add(middle)
            open_parts += [(start, middle), (middle, end)]
    return np.array(sorted(kept))


def _sides(first: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.where(np.arange(len(first) - 1) == 0, TRUNK_SIDES, SIDES)


def _n_faces(first: NDArray[np.int64]) -> int:
    """Triangles of the tubes along polylines with these bounds (L + 1,): walls, tip and base."""
    sides, rings = _sides(first), np.diff(first)
    return int((2 * sides * (rings - 1) + sides + (sides - 2)).sum())


def _bark_uv(tubes: Tubes, rings: Rings, bark: Bark) -> NDArray[np.float64]:
    """Texture coordinates (P, 2) in repeats of the bark: a whole number around each limb, true to length along it."""
    thickest = np.maximum.reduceat(rings.radius, rings.first[:-1])
    repeats = np.maximum(1, np.round(2 * np.pi * thickest / bark.width_m))
    u = tubes.angle / (2 * np.pi) * repeats[tubes.limb]
    return np.column_stack([u, rings.station[tubes.ring] / bark.height_m])
