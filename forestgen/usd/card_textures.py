"""The draw mode of a component: six pictures that stand for it where `model:drawMode` is set to "cards"."""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike
from pxr import Gf, Sdf, Usd, UsdGeom

from forestgen.usd.materials import linear_from_srgb

AXES = ("XPos", "YPos", "ZPos", "XNeg", "YNeg", "ZNeg")


def card_name(face: str) -> str:
    """The name of a face's picture: card_x_pos and so on."""
    return f"card_{face[0].lower()}_{face[1:].lower()}"


def define_draw_mode(prim: Usd.Prim, textures: Mapping[str, str], srgb: ArrayLike) -> None:
    """Give a model its cards: asset paths by face (XPos ... ZNeg), and a colour (3,) sRGB for bare boxes.

    The mode itself stays unset, so that the tree is drawn in full until someone sets `model:drawMode`, here or on
    any prim above, to "cards" (or "bounds"). The pictures fill the faces of the model's box, cross-wise.

    Raises:
        ValueError: a face is missing, or unknown; nothing is authored then.
    """
    if set(textures) != set(AXES):
        raise ValueError(f"{prim.GetPath()}: card textures for {sorted(textures)}; expected {sorted(AXES)}")
    model = UsdGeom.ModelAPI.Apply(prim)
    model.CreateModelApplyDrawModeAttr(True)
    model.CreateModelCardGeometryAttr(UsdGeom.Tokens.cross)
    model.CreateModelDrawModeColorAttr(Gf.Vec3f(*linear_from_srgb(srgb).tolist()))
    for face in AXES:
        prim.GetAttribute(f"model:cardTexture{face}").Set(Sdf.AssetPath(textures[face]))
