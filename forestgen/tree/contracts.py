"""Contracts of the stages that have one file an algorithm and no folder: radius, bark, mesh, atlas, leaves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from forestgen.tree.model import Atlas, Bark, Leaves, Mesh
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View


class Radius(Protocol):
    """How thick every node is: a skeleton of the same nodes, no radius NaN. Measured ones may be kept."""

    def __call__(self, skeleton: Skeleton, views: Sequence[View]) -> Skeleton: ...


class MakeBark(Protocol):
    """A tileable piece of bark from the photos, or one pixel of plain colour."""

    def __call__(self, views: Sequence[View], *, rng: np.random.Generator) -> Bark: ...


class MakeMesh(Protocol):
    """The wood's surface. Its radii must be known."""

    def __call__(self, skeleton: Skeleton, bark: Bark) -> Mesh: ...


class MakeAtlas(Protocol):
    """The leaf texture and its prototypes; none where the tree is bare."""

    def __call__(self, views: Sequence[View], *, rng: np.random.Generator) -> Atlas: ...


class PlaceLeaves(Protocol):
    """Leaves attached to the skeleton's young wood; none where the atlas has no prototype."""

    def __call__(
        self, skeleton: Skeleton, views: Sequence[View], atlas: Atlas, *, rng: np.random.Generator
    ) -> Leaves: ...
