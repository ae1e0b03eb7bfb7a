"""Extras: what a tree's asset holds beside the tree itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.level import Level
from forestgen.tree.seasons import Season
from forestgen.usd.seasons import SeasonLook

CARDS = "leaf_cards"  # prim, material and picture
LEAF, BARK = "leaf", "bark"  # materials and pictures


def picture_path(name: str) -> str:
    """The asset path of a picture, from the tree's root layer."""
    return f"./textures/{name}.png"


@dataclass(frozen=True, eq=False)
class Extras:
    """What to write beside the tree. Each level serves smaller sizes on the screen than the one before."""

    levels: tuple[Level, ...] = ()  # those after the full one
    pictures: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)  # (H, W, 4) sRGB, by file name
    seasons: Mapping[Season, SeasonLook] = field(default_factory=dict)  # with `photo`, or none
    openpbr: bool = False  # a second look of the materials
    wind: bool = False  # primvars for shaders that bend branches
    guides: bool = False  # the skeleton as curves and JSON, and capsules to collide with

    def __post_init__(self) -> None:
        sizes = [level.switch_px for level in self.levels]
        if sizes != sorted(sizes, reverse=True) or len(set(sizes)) < len(sizes):
            raise ValueError(f"Extras.levels must serve smaller and smaller sizes, came {sizes}")
        if any(len(level.cards.faces) for level in self.levels) and CARDS not in self.pictures:
            raise ValueError(f"Extras.levels has cards; expected {CARDS!r} among {sorted(self.pictures)}")
