"""Stage `segment`: a photo and its strokes become two mattes, foliage and branch."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.strokes import Strokes


class Segment(Protocol):
    """Contract of a segmenter. Raises StageError when neither leaf nor branch pixels are found."""

    def __call__(self, photo: Photo, strokes: Strokes, *, rng: np.random.Generator) -> Mattes: ...
