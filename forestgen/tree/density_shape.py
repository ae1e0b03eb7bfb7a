"""Shape of a crown from its silhouettes: of all volumes with these outlines, one without the hull's corners.

Two silhouettes bound a crown at each height by a rectangle; nobody sees what of its corners is filled. A solid
of elliptical section is told by its outlines alone: with s = 1 - (x / half-width)^2 in each of two views at a
right angle, its points are those where the sum of both s is 1 or more. Lobes and notches are rounded in the same
way by the height of a membrane blown up over the silhouette, and evened out in space. Where this leaves a square
of a silhouette without a voxel, the likeliest part of its ray is filled: both outlines stay whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import spsolve

from forestgen.camera import Camera
from forestgen.tree.density import DensityVolume
from forestgen.tree.density_rays import Raster, rasterise

CLOSE = 0.02  # of the height: gaps narrower than twice this are leaves apart, not holes (as the measures have it)
EVEN = 0.02  # of the height: sigma of the roundness in space; lobes of two outlines do not meet to the voxel
ASTRAY = 0.03  # of the height: so far may silhouettes contradict each other (perspective, sway, a hand's scale)
DEEP = 0.5  # of its width: how deep a lobe is that only one view shows; 1 costs half of what the rounding gains
THIN = 0.1  # of a square: wood thinner than a square keeps those that it fills most
SIDE_VIEW = np.deg2rad(30)  # a second photo from at least this far round tells the depth


@dataclass(frozen=True, eq=False)
class Silhouette:
    """A view's outline on a raster, and how deep inside it each square lies."""

    is_tree: Raster  # (R, C) 1 inside
    roundness: Raster  # (R, C) 1 on the middle, 0 at the rim; outside below 0, -1 at the tolerated distance
    half: NDArray[np.float64]  # (R, C) half the thickness that its lobe has if it is as deep as wide, squares
    is_seen: bool = True  # False: nobody photographed it, it is assumed


def silhouette(density: NDArray[np.float64], camera: Camera, grid: DensityVolume, height: float) -> Silhouette:
    """The outline of a view's density (H, W), closed over small gaps; `height` of the tree in metres."""
    closed = close(density >= 0.5, CLOSE * height * camera.px_per_metre)
    share = rasterise(closed.astype(np.float64), camera, grid)
    return _silhouette(_thin_or_half(share.value), share, ASTRAY * height / grid.edge)


def side_silhouette(front: Silhouette, height: float, edge: float) -> Silhouette:
    """What one photo lets expect a quarter round: as wide as the front at each height, about the trunk."""
    camera = replace(front.is_tree.camera, azimuth=front.is_tree.camera.azimuth + np.pi / 2)
    inside = front.is_tree.value > 0
    rows = np.flatnonzero(inside.any(axis=1))
    width = np.zeros(len(inside))
    width[rows] = _last(inside[rows]) - _first(inside[rows]) + 1
    trunk = (camera.root_px[0] - front.is_tree.corner[0]) / front.is_tree.square - 0.5
    off = np.abs(np.arange(inside.shape[1]) - trunk)
    is_side = off[None] <= np.maximum(0.5 * width, 0.5)[:, None]
    is_side[width == 0] = False
    side = _silhouette(is_side, replace(front.is_tree, camera=camera), ASTRAY * height / edge)
    return replace(side, is_seen=False)


def _silhouette(inside: NDArray[np.bool_], raster: Raster, tolerance: float) -> Silhouette:
    away = distance_transform_edt(~inside)
    blown = membrane(inside)
    inner = 0.5 * (row_ellipses(inside) + row_share(blown))
    roundness = np.where(inside, inner, -away / max(tolerance, 1.0))
    return Silhouette(
        replace(raster, value=inside.astype(np.float64)), replace(raster, value=roundness), np.sqrt(blown)
    )


def _thin_or_half(share: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Squares (R, C) that are half covered, and the fullest across anything thinner than a square that leads on."""
    padded = np.pad(share, 1)
    left, right, above, below = padded[1:-1, :-2], padded[1:-1, 2:], padded[:-2, 1:-1], padded[2:, 1:-1]
    is_upright = (share >= left) & (share > right) & ~_is_end(above, below)
    is_flat = (share >= above) & (share > below) & ~_is_end(left, right)
    return np.asarray((share >= 0.5) | ((share >= THIN) & (is_upright | is_flat)))


def _is_end(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether something full lies on one side and nothing on the other: a rim, not a thin part."""
    return ((before >= 0.5) & (after < THIN)) | ((after >= 0.5) & (before < THIN))


def close(mask: NDArray[np.bool_], radius_px: float) -> NDArray[np.bool_]:
    """A mask (H, W) closed by a disc, by OpenCV's rounded distances, which grow a little more than exact ones.

    Exact ones (`closing.close`) cost two photos 0.004 of their outlines and of what lies between them.
    """
    margin = int(np.ceil(radius_px)) + 1
    wide = np.pad(mask, margin).astype(np.uint8)
    grown = cv2.distanceTransform(1 - wide, cv2.DIST_L2, 5) <= radius_px
    closed = cv2.distanceTransform(grown.astype(np.uint8), cv2.DIST_L2, 5) > radius_px
    return np.asarray((closed | (wide > 0))[margin:-margin, margin:-margin])


def row_ellipses(inside: NDArray[np.bool_]) -> NDArray[np.float64]:
    """1 - (x / half-width)^2 of each square (R, C) inside, about the middle of its row's extent."""
    rows = np.flatnonzero(inside.any(axis=1))
    first, last = _first(inside[rows]), _last(inside[rows])
    off = (np.arange(inside.shape[1]) - 0.5 * (first + last)[:, None]) / (0.5 * (last - first + 1))[:, None]
    out = np.zeros(inside.shape)
    out[rows] = np.where(inside[rows], 1 - off**2, 0.0)
    return out


def membrane(inside: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Height (R, C) of a membrane blown up over a mask: Laplace's operator gives -4, at the rim it is 0.

    Over a disc it is r^2 - x^2 - y^2, the square of half a ball's thickness.
    """
    count = int(np.count_nonzero(inside))
    number = np.full(np.add(inside.shape, 2), -1)
    number[1:-1, 1:-1][inside] = np.arange(count)
    own = number[1:-1, 1:-1][inside]
    sides = [number[:-2, 1:-1], number[2:, 1:-1], number[1:-1, :-2], number[1:-1, 2:]]
    beside = np.stack([side[inside] for side in sides])
    square, way = np.nonzero(beside.T >= 0)
    links = csr_array((np.ones(len(square)), (own[square], beside[way, square])), shape=(count, count))
    height = np.zeros(inside.shape)
    if count:
        height[inside] = spsolve((diags_array(np.full(count, 4.0)) - links).tocsc(), np.full(count, 4.0))
    return height


def row_share(height: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights (R, C) as a share of the highest in their row."""
    return np.asarray(height / np.maximum(height.max(axis=1, keepdims=True), 1e-12))


def shape_crown(silhouettes: Sequence[Silhouette], grid: DensityVolume, height: float) -> NDArray[np.bool_]:
    """Which voxels (I, J, K) belong to the tree."""
    points, voxel = grid.centres(), np.arange(grid.alpha.size)
    inner = np.zeros((0, grid.alpha.size))
    for s in silhouettes:
        found = s.roundness.at(points, outside=-np.inf)
        near = found > -1
        points, voxel, inner = points[near], voxel[near], np.vstack([inner, found])[:, near]
    least = inner.min(axis=0)
    weight = across_weights([s.roundness.camera for s in silhouettes])
    solid = np.zeros(grid.alpha.shape)  # 1 on an ellipse's rim, 2 on its axis
    solid.flat[voxel] = np.where(least > 0, 2 - weight @ (1 - inner), 0.0)
    solid = gaussian_filter(solid, EVEN * height / grid.edge, mode="constant")
    rank = np.where(least > 0, solid.flat[voxel], least - 1)
    filled = rank >= 1
    for s in silhouettes:
        if s.is_seen:
            filled |= likeliest(s, points, filled, rank)
    crown = np.zeros(grid.alpha.shape, bool)
    crown.flat[voxel] = filled
    return crown


def likeliest(
    outline: Silhouette, points: NDArray[np.float64], filled: NDArray[np.bool_], rank: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Points (N,) that explain those squares of a silhouette that no filled one does: the highest in rank (N,).

    About it the ray is filled in proportion to the lobe's width, as far as the hull goes (rank 0): no sheets.
    """
    square, inside = outline.is_tree.nearest(points)
    is_open = outline.is_tree.value.ravel() > 0
    is_open[square[filled & inside]] = False
    able = np.flatnonzero(inside & is_open[square])
    square, rank = square[able], rank[able]
    best = np.full(is_open.size, -np.inf)
    np.maximum.at(best, square, rank)
    is_best = rank == best[square]
    depth = outline.is_tree.camera.depth(points[able])
    many = np.bincount(square[is_best], minlength=is_open.size)
    middle = np.bincount(square[is_best], depth[is_best], minlength=is_open.size) / np.maximum(many, 1)
    reach = DEEP * outline.half.ravel() * outline.is_tree.square / outline.is_tree.camera.px_per_metre
    chosen = np.zeros(len(points), bool)
    chosen[able] = is_best | ((rank > 0) & (np.abs(depth - middle[square]) <= reach[square]))
    return chosen


def across_weights(cameras: Sequence[Camera]) -> NDArray[np.float64]:
    """How much the squared offset across each view (V,) counts, so that together they measure a circle's radius.

    Two views at a right angle count 1 each, three at 60 degrees 2/3; others come as near to a circle as they can.
    """
    right = np.array([[np.cos(c.azimuth), -np.sin(c.azimuth)] for c in cameras])
    forms = np.stack([right[:, 0] ** 2, right[:, 1] ** 2, np.sqrt(2) * right[:, 0] * right[:, 1]])
    from scipy.optimize import nnls  # 0.07 s, which trees from one photo spare

    return np.asarray(nnls(forms, np.array([1.0, 1.0, 0.0]))[0])


def is_one_sided(cameras: Sequence[Camera]) -> bool:
    """Whether all views look along nearly the same line, so that none tells the depth."""
    azimuth = np.array([c.azimuth for c in cameras])
    return bool(np.abs((azimuth[:, None] - azimuth + np.pi / 2) % np.pi - np.pi / 2).max() < SIDE_VIEW)


def _first(rows: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.asarray(rows.argmax(axis=1))


def _last(rows: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.asarray(rows.shape[1] - 1 - rows[:, ::-1].argmax(axis=1))
