"""Stage `grow`: the visible skeleton becomes the whole tree's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import OnStep
from forestgen.tree.view import View


class Grow(Protocol):
    """Contract of a grower: the visible branches stay as they came in.

    Their nodes keep their places in the photos, radii and order, and come first; one that lies
    outside the crown may move along the camera's ray; others may be put between them, on
    the same branch and with radii between theirs. What has grown follows, with radius NaN.
    """

    def __call__(
        self, skeleton: Skeleton, views: Sequence[View], *, rng: np.random.Generator, on_step: OnStep | None = None
    ) -> Skeleton: ...
