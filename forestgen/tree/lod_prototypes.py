"""Simpler leaf prototypes for coarse levels: a bent strip over the same atlas cell instead of a trimmed blade."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.model import LeafPrototype, vertex_normals

SAMPLES = 15  # points along a triangle's side at which the texture is asked
PETIOLE_MOST = 0.2  # share of the area; a foot whose triangles hold more is part of the blade


def simpler(prototype: LeafPrototype, triangles: int) -> LeafPrototype:
    """The leaf as a strip of at most so many triangles over the box of its blade's uv: 2 are flat, 4 bent once.

    The strip lies where the parabola v -> space that fits the blade best does, so uv and space belong
    together as they did. The petiole, thinner than a pixel wherever this is used, is left out. A leaf
    that has no more triangles stays as it is.

    Raises:
        ValueError: fewer than 2 triangles.
    """
    if triangles < 2:
        raise ValueError(f"triangles is {triangles}; a strip has at least 2")
    if len(prototype.faces) <= triangles:
        return prototype
    rows = triangles // 2 + 1
    faces = _blade(prototype)
    area = face_areas(prototype.points, faces)
    weight = np.bincount(np.repeat(faces, 3, axis=0).ravel(), np.repeat(area, 9), len(prototype.points))
    used = np.unique(faces)
    low, high = prototype.uv[used].min(axis=0), prototype.uv[used].max(axis=0)
    if not np.all(high > low):
        return prototype
    order = min(rows - 1, 2)
    uv = np.array([[u, v] for v in np.linspace(low[1], high[1], rows) for u in (low[0], high[0])])
    root = np.sqrt(weight[used])[:, None]
    centre, half = (low + high) / 2, (high - low) / 2
    fit, *_ = np.linalg.lstsq(
        root * _terms((prototype.uv[used] - centre) / half, order), root * prototype.points[used], rcond=None
    )
    points = _terms((uv - centre) / half, order) @ fit
    strip = (2 * np.arange(rows - 1)[:, None, None] + np.array([[0, 1, 3], [0, 3, 2]])).reshape(-1, 3)
    if _faces_back(points, strip, prototype, faces):
        strip = strip[:, ::-1]
    normals = vertex_normals(points, strip)
    return LeafPrototype(points, normals, uv, strip, prototype.colour, prototype.length_px)


def covered_area(prototype: LeafPrototype, rgba: NDArray[np.uint8]) -> float:
    """Area of the leaf's opaque part, in squares of its length; texture (H, W, 4) with straight alpha."""
    steps = (np.arange(SAMPLES) + 1 / 3) / SAMPLES
    a, b = np.meshgrid(steps, steps)
    inside = a + b < 1
    share = np.stack([1 - a[inside] - b[inside], a[inside], b[inside]], axis=1)  # (S, 3) barycentric
    at = np.einsum("sk,fkc->fsc", share, prototype.uv[prototype.faces])
    height, width = rgba.shape[:2]
    column = np.clip((at[..., 0] * width).astype(np.int64), 0, width - 1)
    row = np.clip(((1 - at[..., 1]) * height).astype(np.int64), 0, height - 1)
    opaque = (rgba[row, column, 3] >= 128).mean(axis=1)
    return float(opaque @ face_areas(prototype.points, prototype.faces))


def face_areas(points: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Area (F,) of triangles."""
    corner = points[faces]
    return np.asarray(np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1) / 2)


def _blade(prototype: LeafPrototype) -> NDArray[np.int64]:
    """The faces (F, 3) but those of the petiole, which meet in its foot at the origin."""
    faces = prototype.faces
    is_foot = np.abs(prototype.points).max(axis=1) < 1e-9
    at_foot = is_foot[faces].any(axis=1)
    area = face_areas(prototype.points, faces)
    is_petiole = at_foot & (area[at_foot].sum() <= PETIOLE_MOST * area.sum())
    return faces[~is_petiole] if not is_petiole.all() else faces


def _terms(place: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """The polynomial's terms (N, 2 + order) at places (N, 2): 1, u, v and, of the second order, v^2."""
    u, v = place.T
    return np.column_stack([np.ones(len(u)), u, v] + ([v * v] if order == 2 else []))


def _faces_back(
    points: NDArray[np.float64], strip: NDArray[np.int64], prototype: LeafPrototype, faces: NDArray[np.int64]
) -> bool:
    """Whether a strip's side is the back of the blade."""
    return float(_total_area(points, strip) @ _total_area(prototype.points, faces)) < 0


def _total_area(points: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Sum (3,) of the faces' area vectors."""
    corner = points[faces]
    return np.asarray(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]).sum(axis=0))
