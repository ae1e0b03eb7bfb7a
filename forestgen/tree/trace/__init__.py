"""Stage `trace`: the visible branches of a photo become a rooted graph in pixels."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.strokes import Strokes


class Trace(Protocol):
    """Contract of a tracer: node 0 is the start of the trunk stroke."""

    def __call__(self, photo: Photo, strokes: Strokes, mattes: Mattes, *, rng: np.random.Generator) -> BranchGraph: ...
