"""Opinions on prims that other layers define, as specs of one layer.

A stage cannot author on what another variant or layer makes inactive or has not brought yet; its layer can.
"""

from __future__ import annotations

from collections.abc import Sequence

from pxr import Sdf, Usd


def add_strongest_set(root: Usd.Prim, name: str, variants: Sequence[str]) -> dict[str, Sdf.PrimSpec]:
    """Add a variant set before all others of a prim, so that its opinions win; its first variant is selected.

    Gives the spec of the prim inside each variant. (UsdVariantSets.AddVariantSet takes a position and ignores it.)
    """
    layer = root.GetStage().GetEditTarget().GetLayer()
    choice = root.GetVariantSets().AddVariantSet(name)
    for variant in variants:
        choice.AddVariant(variant)
    choice.SetVariantSelection(variants[0])
    names = layer.GetPrimAtPath(root.GetPath()).variantSetNameList
    names.prependedItems = [name, *(other for other in names.prependedItems if other != name)]
    path = root.GetPath()
    return {variant: layer.GetPrimAtPath(path.AppendVariantSelection(name, variant)) for variant in variants}


def over(spec: Sdf.PrimSpec, below: str) -> Sdf.PrimSpec:
    """The spec of a prim below another; those missing are made, as overs."""
    return Sdf.CreatePrimInLayer(spec.layer, spec.path.AppendPath(below))


def attribute(spec: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName) -> Sdf.AttributeSpec:
    """The spec of an attribute that a schema or another layer declares; made where it is missing."""
    return spec.attributes.get(name) or Sdf.AttributeSpec(spec, name, kind)
