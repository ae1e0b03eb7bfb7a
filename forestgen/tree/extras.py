"""Extras: what a tree's asset holds beside the tree itself."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.level import Level

NO_CARDS = np.zeros((1, 1, 4), np.uint8)


@dataclass(frozen=True, eq=False)
class Extras:
    """What to write beside the tree. Each level serves smaller sizes on the screen than the one before."""

    levels: tuple[Level, ...] = ()  # those after the full one
    card_atlas: NDArray[np.uint8] = field(default_factory=lambda: NO_CARDS)  # (H, W, 4) sRGB
    wind: bool = False  # primvars for shaders that bend branches
    guides: bool = False  # the skeleton as curves and JSON, and capsules to collide with
    notes: tuple[str, ...] = ()  # what could not be made, for the user

    def __post_init__(self) -> None:
        freeze(self, card_atlas=(np.uint8, "H", "W", 4))
        sizes = [level.switch_px for level in self.levels]
        if sizes != sorted(sizes, reverse=True) or len(set(sizes)) < len(sizes):
            raise ValueError(f"Extras.levels must serve smaller and smaller sizes, came {sizes}")

    @property
    def has_cards(self) -> bool:
        return any(len(level.cards.faces) for level in self.levels)
