"""Drawable: triangles with a texture, and every place where they stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.camera import Camera


@dataclass(frozen=True, eq=False, kw_only=True)
class Drawable:
    """One mesh, drawn once for each of its transforms. P points, F faces, K places.

    Texels count as there where alpha (colour's times the texture's) reaches `alpha_threshold`;
    a threshold of 0 (a blended material) is read as 0.5.
    """

    name: str
    points: NDArray[np.float64]  # (P, 3) m
    faces: NDArray[np.int64]  # (F, 3) into points
    uv: NDArray[np.float64] | None = None  # (P, 2) v upward, the texture repeats
    normals: NDArray[np.float64] | None = None  # (P, 3) unit; found from the faces where absent
    texture: NDArray[np.uint8] | None = None  # (H, W, 4) sRGB and straight alpha, row 0 on top
    colour: NDArray[np.float64] = field(default_factory=lambda: np.ones(4))  # (4,) sRGB and alpha in [0, 1]
    alpha_threshold: float = 0.5
    is_leaf: bool = False
    transforms: NDArray[np.float64] = field(default_factory=lambda: np.eye(4)[None])  # (K, 4, 4) world, column vectors

    def __post_init__(self) -> None:
        freeze(
            self,
            points=(np.float64, "P", 3),
            faces=(np.int64, "F", 3),
            colour=(np.float64, 4),
            transforms=(np.float64, "K", 4, 4),
            **({} if self.uv is None else {"uv": (np.float64, "P", 2)}),
            **({} if self.normals is None else {"normals": (np.float64, "P", 3)}),
            **({} if self.texture is None else {"texture": (np.uint8, "H", "W", 4)}),
        )
        if self.faces.size and not (self.faces.min() >= 0 and self.faces.max() < len(self.points)):
            raise ValueError(f"Drawable {self.name!r}: faces point outside its points")

    @property
    def n_triangles(self) -> int:
        """Triangles as drawn, all places counted."""
        return len(self.faces) * len(self.transforms)


def extent_along(drawables: Sequence[Drawable], axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least and greatest extent (2, A) in metres of all that is drawn, along axes (A, 3).

    Raises:
        ValueError: nothing is there to be drawn.
    """
    low, high = [], []
    for drawable in drawables:
        if not (len(drawable.faces) and len(drawable.transforms)):
            continue
        is_used = np.zeros(len(drawable.points), bool)
        is_used[drawable.faces] = True
        used = drawable.points[is_used]
        ahead = np.einsum("ai,kij->akj", axes, drawable.transforms[:, :3, :3])
        start = axes @ drawable.transforms[:, :3, 3].T
        along = ahead @ used.T  # (A, K, P)
        low.append((along.min(axis=2) + start).min(axis=1))
        high.append((along.max(axis=2) + start).max(axis=1))
    if not low:
        raise ValueError("there is nothing to draw: no drawable has a face and a place")
    return np.array([np.min(low, axis=0), np.max(high, axis=0)])


def frame_camera(
    drawables: Sequence[Drawable],
    *,
    azimuth: float,
    elevation: float = 0.0,
    size: tuple[int, int] = (640, 800),
    margin: float = 0.05,
) -> Camera:
    """An orthographic camera (angles in radians) that shows all of the drawables in the middle of its frame."""
    axes = Camera(size, (0.0, 0.0), 1.0, azimuth, elevation).axes
    low, high = extent_along(drawables, axes)
    room = np.array(size) * (1 - 2 * margin)
    px_per_metre = float(np.min(room / np.maximum(high[:2] - low[:2], 1e-6)))
    middle = (low[:2] + high[:2]) / 2 * px_per_metre
    root = (size[0] / 2 - middle[0], size[1] / 2 + middle[1])
    return Camera(size, (float(root[0]), float(root[1])), px_per_metre, azimuth, elevation)
