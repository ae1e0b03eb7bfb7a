"""Stage `grow`: the visible skeleton becomes the whole tree's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import OnStep
from forestgen.tree.view import View


class Grow(Protocol):
    """Contract of a grower: the nodes that came in keep their indices, places and radii;
    new nodes are appended with radius NaN."""

    def __call__(
        self, skeleton: Skeleton, views: Sequence[View], *, rng: np.random.Generator, on_step: OnStep | None = None
    ) -> Skeleton: ...
