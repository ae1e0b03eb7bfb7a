"""A tree with all its variants: three levels of detail, seasons, light and looks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Sdf, Usd

from forestgen.png import write_png
from forestgen.tree.level import full_level
from forestgen.usd.layers import save
from forestgen.usd.lights import define_delit_texture, define_light_variants
from forestgen.usd.looks import LookMaterial, define_look_variants, look_layer
from forestgen.usd.seasons import Dress, SeasonLook, define_seasons
from forestgen.usd.tree_asset import write_tree_asset
from tests.usd.models import tree_model
from tests.usd.test_levels import extras

FALLEN = {"LOD0": np.array([1, 2, 30]), "LOD1": np.array([0, 16])}
BROWN, PALE = (120, 70, 30), (150, 150, 140)

MODEL = tree_model()
LEVELS = {f"LOD{k}": level for k, level in enumerate((full_level(MODEL), *extras(MODEL).levels))}
DRESS = Dress(LEVELS, ("leaf", "leaf_cards"), ("leaf",), has_openpbr=True)


def looks() -> dict[str, SeasonLook]:
    def path(name: str) -> str:
        return f"./textures/{name}.png"

    autumn = {"leaf": path("leaf_autumn"), "leaf_cards": path("leaf_cards_autumn")}
    return {
        "photo": SeasonLook(),
        "autumn": SeasonLook(autumn, {"leaf": path("leaf_autumn_delit")}, FALLEN),
        "winter": SeasonLook(pictures={"leaf_cards": path("leaf_cards_winter")}, is_bare=True),
    }


def dressed(path: Path, dress: Dress) -> None:
    """All three sets on a written tree with a leaf of two textures."""
    folder, name = path.parent, path.stem
    materials = Usd.Stage.Open(str(folder / "materials.usdc"))
    define_delit_texture(materials, Sdf.Path(f"/{name}/mtl/leaf"), "./textures/leaf_delit.png")
    materials.Save()
    look = look_layer(
        name,
        [
            LookMaterial("bark", "./textures/bark.png"),
            LookMaterial("leaf", "./textures/leaf.png", is_leaf=True, delit="./textures/leaf_delit.png"),
            LookMaterial("leaf_cards", "./textures/leaf_cards.png", is_leaf=True),
        ],
    )
    save(look, folder / "openpbr.usdc")
    stage = Usd.Stage.Open(str(path), Usd.Stage.LoadNone)
    root = stage.GetDefaultPrim()
    define_look_variants(root)
    define_light_variants(root, ["leaf"])
    layers = define_seasons(root, looks(), dress)  # type: ignore[arg-type]
    assert list(layers) == ["autumn.usdc"]
    for name_of, layer in layers.items():
        save(layer, folder / name_of)
    stage.Save()
    for texture, colour in {
        "leaf_autumn": BROWN,
        "leaf_delit": PALE,
        "leaf_autumn_delit": PALE,
        "leaf_cards_autumn": BROWN,
        "leaf_cards_winter": BROWN,
    }.items():
        rgba = np.full((32, 48, 4), 255, np.uint8)
        rgba[..., :3] = colour
        write_png(folder / "textures" / f"{texture}.png", rgba)


def write_dressed(folder: Path) -> Path:
    """The root layer of a tree `oak` with three levels and all sets."""
    path = write_tree_asset(MODEL, folder / "oak", extras(MODEL))
    dressed(path, DRESS)
    return path


def chosen(path: Path, **variants: str) -> Usd.Stage:
    """The tree with these variants selected by a layer that references it."""
    stage = Usd.Stage.CreateInMemory()
    root = stage.DefinePrim("/oak", "Xform")
    root.GetReferences().AddReference(str(path))
    for name, variant in variants.items():
        root.GetVariantSet(name).SetVariantSelection(variant)
    return stage
