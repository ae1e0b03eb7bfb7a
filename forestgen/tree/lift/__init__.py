"""Stage `lift`: the views' branch graphs become one skeleton in three dimensions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View


class Lift(Protocol):
    """Contract of a lifter. A single-view lifter raises StageError when given two views.

    Measured radii come along (px over px_per_metre); nodes without one have radius NaN.
    """

    def __call__(self, views: Sequence[View], *, rng: np.random.Generator) -> Skeleton: ...
