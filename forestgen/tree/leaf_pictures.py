"""All leaf textures of a tree: one a season, with the photo's light and, where asked for, without."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import stage_rng
from forestgen.tree.delight import delit
from forestgen.tree.model import Atlas
from forestgen.tree.seasons import Season, season_atlas


@dataclass(frozen=True, eq=False)
class LeafPictures:
    """Textures over one layout of cells. Seasons that look alike share a file."""

    files: Mapping[str, NDArray[np.uint8]]  # (H, W, 4) by file name
    baked: Mapping[Season, str]  # file of each season that shows leaves
    delit: Mapping[Season, str]  # the same without the photo's light; empty where not asked for


def picture_name(material: str, season: Season, *, is_delit: bool = False) -> str:
    """The file of a material's picture: leaf.png, leaf_autumn.png, leaf_delit.png, leaf_autumn_delit.png."""
    return "_".join([material, *([] if season == "photo" else [season]), *(["delit"] if is_delit else [])]) + ".png"


def leaf_pictures(
    atlas: Atlas, seasons: Sequence[Season], *, evergreen: bool = False, with_delit: bool = False, seed: int
) -> LeafPictures:
    """The leaf textures of some seasons. What shows no leaves has none: a bare tree, the winter of a deciduous one."""
    files: dict[str, NDArray[np.uint8]] = {}
    baked: dict[Season, str] = {}
    plain: dict[Season, str] = {}
    for season in seasons if atlas.prototypes else ():
        if season == "winter" and not evergreen:
            continue
        rgba = season_atlas(atlas, season, evergreen=evergreen, rng=stage_rng(seed, "season", season))
        baked[season] = _keep(files, picture_name("leaf", season), rgba)
        if with_delit:
            name = picture_name("leaf", season, is_delit=True)
            plain[season] = _keep(files, name, delit(Atlas(rgba, atlas.prototypes)))
    return LeafPictures(files, baked, plain)


def _keep(files: dict[str, NDArray[np.uint8]], name: str, rgba: NDArray[np.uint8]) -> str:
    """The name of the file with this picture: of one that is there already, else a new one."""
    for known, picture in files.items():
        if np.array_equal(picture, rgba):
            return known
    files[name] = rgba
    return name
