"""Working size: very large photos are segmented smaller, and their mattes enlarged again."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.strokes import Strokes

MOST_PIXELS = 4_000_000  # of a photo that is segmented as it is: bounds time and memory to about three times 1500 px


def shrink(photo: Photo, strokes: Strokes) -> tuple[Photo, Strokes]:
    """A photo of at most MOST_PIXELS with its strokes; the same two where it is no larger."""
    width, height = photo.size
    factor = (MOST_PIXELS / (width * height)) ** 0.5
    if factor >= 1:
        return photo, strokes
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    by = np.array(size) / photo.size
    small = Photo(np.asarray(cv2.resize(photo.rgb, size, interpolation=cv2.INTER_AREA)), photo.name)
    return small, replace(
        strokes,
        crown=strokes.crown * by,
        branches=tuple(path * by for path in strokes.branches),
        background=tuple(path * by for path in strokes.background),
        density=tuple(replace(s, path=s.path * by, radius_px=s.radius_px * factor) for s in strokes.density),
        size=size,
    )


def enlarge(mattes: Mattes, size: tuple[int, int]) -> Mattes:
    """The mattes at a photo's (width, height); the same where they have it."""
    if mattes.foliage.shape[::-1] == size:
        return mattes

    def up(alpha: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.clip(np.asarray(cv2.resize(alpha, size, interpolation=cv2.INTER_LINEAR), np.float32), 0, 1)

    return Mattes(up(mattes.foliage), up(mattes.branch))
