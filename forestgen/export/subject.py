"""What is exported: a tree, the levels of detail that the file is to hold, and the picture on its cards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forestgen.errors import InputError
from forestgen.tree.level import Level
from forestgen.tree.model import LeafPrototype, Mesh, TreeModel


@dataclass(frozen=True, eq=False)
class Subject:
    """A tree with levels, the finest first, of which everything that is drawn has its texture."""

    model: TreeModel
    levels: tuple[Level, ...]
    card_rgba: NDArray[np.uint8] | None = None  # (H, W, 4) sRGB and straight alpha; None where no level has cards

    def __post_init__(self) -> None:
        name = self.model.name
        if not self.levels:
            raise ValueError(f"{name}: expected at least one level of detail, came none")
        sizes = [level.switch_px for level in self.levels]
        if any(low >= high for high, low in pairwise(sizes)):
            raise ValueError(f"{name}: levels must switch at ever smaller sizes, came {sizes}")
        for k, level in enumerate(self.levels):
            if not level.n_triangles:
                raise InputError(f"{name}: level {k} has nothing to draw, neither wood nor leaves; leave it out")
            if len(level.leaves) and self.model.atlas.rgba.shape[:2] == (1, 1):
                raise InputError(f"{name}: has {len(level.leaves)} leaves but no leaf atlas; build the tree again")
            if len(level.cards.faces) and self.card_rgba is None:
                raise InputError(f"{name}: level {k} has cards but no card atlas; build the tree again")
            require_finite(name, [level.mesh, level.cards, *level.prototypes])
            if not (np.isfinite(level.leaves.position).all() and np.isfinite(level.leaves.size).all()):
                raise ValueError(f"{name}: level {k} has leaves whose place or size is not a number")

    @property
    def has_plain_bark(self) -> bool:
        """Whether the bark is one colour, without a picture."""
        return self.model.bark.rgb.shape[:2] == (1, 1)


def require_finite(name: str, meshes: Sequence[Mesh | LeafPrototype]) -> None:
    """Refuse what no file could hold.

    Raises:
        ValueError: a coordinate is not a number.
    """
    for mesh in meshes:
        for field in ("points", "normals", "uv"):
            if not np.isfinite(getattr(mesh, field)).all():
                raise ValueError(f"{name}: {field} of a mesh hold NaN")


def require_target(path: Path, suffix: str) -> None:
    """Refuse a path to which no such file can be written.

    Raises:
        InputError: another suffix, or a folder of that name.
    """
    if path.suffix.lower() != suffix:
        raise InputError(f"{path}: expected a name that ends in {suffix}")
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file to write")
