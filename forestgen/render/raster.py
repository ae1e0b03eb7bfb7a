"""Raster: pictures of drawables without OpenGL, with their leaves in the colours of several seasons at once.

What a build draws for an asset: many small triangles, seen once and worn in each season. OpenGL without a graphics
card would draw them anew for each season, and spends its time on setting such triangles up: six sides of an oak in
three seasons took 7.4 s of processor time, and take 1.9 s. What is judged is drawn by the studio. Samples lie where
OpenGL's do; colours are interpolated between a texture's levels, alpha is read from its full resolution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.render.drawable import Drawable
from forestgen.render.raster_kernels import cover, seen, shade

Picture = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Batch:
    """P points and F faces as a camera sees them."""

    first: int  # number of the first face among all that are drawn
    points: NDArray[np.float32]  # (P, 3) px right, px down, metres nearer
    uv: NDArray[np.float32]  # (P, 2)
    faces: NDArray[np.int32]  # (F, 3)


def pictures(
    drawables: Sequence[Drawable], camera: Camera, atlases: Sequence[NDArray[np.uint8] | None]
) -> list[Picture]:
    """All drawables, unlit, with their leaves over each of some atlases; without leaves where that is None.

    As `Studio.colour` has them: premultiplied sRGB-encoded RGBA (H, W, 4) in [0, 1], four samples a pixel. The
    atlases (h, w, 4) differ in their colours only: the first one's alpha cuts the leaves out.

    Raises:
        ValueError: the camera has a focal length, or a drawable no texture.
    """
    canvas = _Canvas(camera)
    wood = [(canvas.draw([d], _texture(d)), _texture(d)) for d in drawables if not d.is_leaf]
    bare = canvas.coloured(wood) if any(atlas is None for atlas in atlases) else canvas.blank()
    worn = next((atlas for atlas in atlases if atlas is not None), None)
    if worn is None:
        return [bare.copy() for _ in atlases]
    leaves = canvas.draw([d for d in drawables if d.is_leaf], worn)
    behind = canvas.coloured(wood)
    return [bare.copy() if atlas is None else canvas.coloured([(leaves, atlas)], behind.copy()) for atlas in atlases]


class _Canvas:
    """What a camera sees so far: the nearest face of each sample."""

    def __init__(self, camera: Camera) -> None:
        if camera.focal_px is not None:
            raise ValueError("pictures are drawn through orthographic cameras; this one has a focal length")
        self.camera, self.n_faces = camera, 0
        size = (camera.size[1], camera.size[0], 4)
        self.depth, self.face = np.full(size, -np.inf, np.float32), np.full(size, -1, np.int32)

    def draw(self, drawables: Sequence[Drawable], texture: NDArray[np.uint8]) -> _Batch:
        """Draw all of them, cut out by one texture's alpha."""
        batch = _batch(drawables, self.camera, self.n_faces)
        threshold = 255 * max((d.alpha_threshold or 0.5 for d in drawables), default=0.5)
        alpha = np.ascontiguousarray(texture[..., 3])
        if alpha.min() == 255:
            alpha = alpha[:0]
        cover(batch.points, batch.uv, batch.faces, alpha, threshold, batch.first, self.depth, self.face)
        self.n_faces += len(batch.faces)
        return batch

    def coloured(self, batches: Sequence[tuple[_Batch, NDArray[np.uint8]]], onto: Picture | None = None) -> Picture:
        """The batches in their textures' colours, added to a picture of others."""
        picture = self.blank() if onto is None else onto
        for batch, texture in batches:
            shade(self.face, batch.first, batch.points, batch.uv, batch.faces, *_levels(texture), picture)
        return picture

    def blank(self) -> Picture:
        """A picture of nothing."""
        return np.zeros((*self.face.shape[:2], 4), np.float32)


def _texture(drawable: Drawable) -> NDArray[np.uint8]:
    if drawable.texture is None:
        raise ValueError(f"Drawable {drawable.name!r} has no texture to draw it with")
    return drawable.texture


def _batch(drawables: Sequence[Drawable], camera: Camera, first: int) -> _Batch:
    """All places of some drawables before a camera."""
    to_camera = np.zeros((3, 4))
    to_camera[:, :3] = camera.axes * np.array([camera.px_per_metre, -camera.px_per_metre, 1.0])[:, None]
    to_camera[:2, 3] = camera.root_px
    n = np.cumsum([0, *(len(d.points) * len(d.transforms) for d in drawables)])
    points, uv = np.empty((n[-1], 3), np.float32), np.zeros((n[-1], 2), np.float32)
    faces = [np.zeros((0, 3), np.int32)]
    for drawable, start, end in zip(drawables, n[:-1], n[1:], strict=True):
        seen(drawable.points, to_camera @ drawable.transforms, points[start:end])
        if drawable.uv is not None:
            uv[start:end] = np.tile(drawable.uv.astype(np.float32), (len(drawable.transforms), 1))
        place = start + np.arange(len(drawable.transforms)) * len(drawable.points)
        faces.append((drawable.faces + place[:, None, None]).reshape(-1, 3).astype(np.int32))
    return _Batch(first, points, uv, np.concatenate(faces))


def _levels(texture: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.int64], NDArray[np.int64]]:
    """A texture (H, W, 4) and its halves down to one texel: texels (N, 3), start (K,) and size (K, 2) of each level."""
    levels = [np.ascontiguousarray(texture[..., :3])]
    while max(levels[-1].shape[:2]) > 1:
        height, width = levels[-1].shape[:2]
        half = max(1, width // 2), max(1, height // 2)
        levels.append(np.asarray(cv2.resize(levels[-1], half, interpolation=cv2.INTER_AREA), np.uint8))
    size = np.array([level.shape[:2] for level in levels], np.int64)
    start = np.concatenate([[0], np.cumsum(size.prod(axis=1))[:-1]])
    return np.concatenate([level.reshape(-1, 3) for level in levels]), start, size
