"""Seasons of a tree as variants of its root prim: other pictures, leaves that have fallen, bare wood.

    variant set season    photo (default): as photographed
                          summer, autumn: other leaf pictures; payload autumn.usdc: invisibleIds of fallen leaves
                          winter: no leaves (inactive), cards of wood; an evergreen has a darker picture instead

A picture is named where the preview surface reads it and, for the OpenPBR look, at the material's own input.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, Vt

from forestgen.tree.level import Level
from forestgen.tree.seasons import SEASONS, Season
from forestgen.usd.geometry import Box, leaves_box, vec3f
from forestgen.usd.layers import new_stage
from forestgen.usd.lights import TEXTURE, TEXTURE_DELIT
from forestgen.usd.looks import PICTURE, PICTURE_DELIT
from forestgen.usd.specs import add_strongest_set, attribute, over

SEASON_SET = "season"


@dataclass(frozen=True, eq=False)
class SeasonLook:
    """What one season changes in a tree as photographed; asset paths are relative to the tree's root layer."""

    pictures: Mapping[str, str] = field(default_factory=dict)  # of leaf materials, by name
    delit: Mapping[str, str] = field(default_factory=dict)  # the same without baked light, where asked for
    fallen: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)  # indices of leaves, by level of detail
    is_bare: bool = False  # no leaves at all
    attributes: Mapping[str, str] = field(
        default_factory=dict
    )  # pictures that the root prim names: model:cardTexture...


@dataclass(frozen=True, eq=False)
class Dress:
    """What seasons can change in a tree that is written."""

    levels: Mapping[str, Level]  # all levels of detail, by name
    materials: Collection[str]  # leaf materials below mtl
    delit: Collection[str] = ()  # those of them that have a second texture without light
    has_openpbr: bool = False  # whether the tree has that look


def define_seasons(root: Usd.Prim, looks: Mapping[Season, SeasonLook], dress: Dress) -> dict[str, Sdf.Layer]:
    """Author the variant set on a tree's root prim, before its other sets; `photo` is selected.

    Gives the layers that its variants bring as payloads, by file name, to be saved beside the tree's other layers:
    which leaves have fallen is too much for a layer of text.

    Raises:
        ValueError: no photo among the looks, or one names a season, level, leaf or material that is not there;
            nothing is authored then.
    """
    where = str(root.GetPath())
    if "photo" not in looks:
        raise ValueError(f"{where}: seasons need 'photo' among them, came {sorted(looks)}")
    for season, look in looks.items():
        _check(f"{where}: season {season!r}", season, look, dress)
    inside = add_strongest_set(root, SEASON_SET, sorted(looks, key=SEASONS.index))
    layers = {}
    for season, look in looks.items():
        _author(inside[season], look, dress)
        if any(len(gone) for gone in look.fallen.values()):
            layers[f"{season}.usdc"] = _fallen_layer(root.GetName(), look, dress)
            inside[season].payloadList.Prepend(Sdf.Payload(f"./{season}.usdc"))
    return layers


def _check(where: str, season: str, look: SeasonLook, dress: Dress) -> None:
    if season not in SEASONS:
        raise ValueError(f"{where} is none; expected one of {', '.join(SEASONS)}")
    for material in look.pictures:
        if material not in dress.materials:
            raise ValueError(f"{where} has a picture for material {material!r}; there is {sorted(dress.materials)}")
    for material in look.delit:
        if material not in dress.delit:
            raise ValueError(f"{where} has a picture without light for {material!r}, which has no second texture")
    for name, gone in look.fallen.items():
        count = len(dress.levels[name].leaves) if name in dress.levels else 0
        if not count:
            raise ValueError(f"{where} lets leaves of {name!r} fall, which has none; levels are {sorted(dress.levels)}")
        if len(gone) and not (gone.min() >= 0 and gone.max() < count):
            raise ValueError(f"{where} lets leaf {gone.max()} of {name} fall, which has {count}")


def _author(root: Sdf.PrimSpec, look: SeasonLook, dress: Dress) -> None:
    nodes = ((look.pictures, TEXTURE, PICTURE), (look.delit, TEXTURE_DELIT, PICTURE_DELIT))
    for pictures, texture, name in nodes:
        for material, picture in sorted(pictures.items()):
            _name_picture(over(root, f"mtl/{material}/{texture}"), "inputs:file", picture)
            if dress.has_openpbr:
                _name_picture(over(root, f"mtl/{material}"), f"inputs:{name}", picture)
    for name, picture in sorted(look.attributes.items()):
        _name_picture(root, name, picture)
    for name, level in sorted(dress.levels.items()):
        if look.is_bare and len(level.leaves):
            over(root, f"geo/{name}/leaves").active = False


def _fallen_layer(tree: str, look: SeasonLook, dress: Dress) -> Sdf.Layer:
    """The layer that hides the fallen leaves of each level; one that loses all of them is inactive."""
    layer = new_stage(tree).GetRootLayer()
    root = Sdf.CreatePrimInLayer(layer, f"/{tree}")
    for name, gone in sorted(look.fallen.items()):
        leaves = over(root, f"geo/{name}/leaves")
        if len(gone) == len(dress.levels[name].leaves):
            leaves.active = False  # an instancer that shows nothing has no extent
        elif len(gone):
            ids = Vt.Int64Array.FromNumpy(np.ascontiguousarray(gone, np.int64))
            attribute(leaves, "invisibleIds", Sdf.ValueTypeNames.Int64Array).default = ids
            box = vec3f(_kept_box(dress.levels[name], gone))
            attribute(leaves, "extent", Sdf.ValueTypeNames.Float3Array).default = box
    return layer


def _name_picture(spec: Sdf.PrimSpec, name: str, picture: str) -> None:
    attribute(spec, name, Sdf.ValueTypeNames.Asset).default = Sdf.AssetPath(picture)


def _kept_box(level: Level, gone: NDArray[np.int64]) -> Box:
    """The box (2, 3) around the leaves that have not fallen."""
    kept = np.setdiff1d(np.arange(len(level.leaves)), gone)
    return leaves_box(level.leaves.take(kept), level.prototypes)
