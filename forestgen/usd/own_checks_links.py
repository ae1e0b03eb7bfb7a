"""Checks of what points elsewhere: picture files, layers, material bindings, shader connections."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from pxr import Sdf, Usd, UsdShade

from forestgen.usd.finding import Finding, own_finding
from forestgen.usd.own_checks_values import Values

ABSOLUTE = re.compile(r"^(/|\\|[A-Za-z]:[\\/]|[A-Za-z][A-Za-z0-9+.-]*://)")  # of Unix, of Windows, or an address
GONE = " is not there"
PACKAGED = re.compile(r"^(.*?\.usdz)\[")


def assets(values: Values) -> Iterator[Finding]:
    """Every file that an attribute names is there, by a relative path, in the folder of its asset.

    A shader's own source (`info:...`) is left out: renderers look it up in their own way.
    """
    for attribute in values.prim.GetAuthoredAttributes():
        kind = attribute.GetTypeName()
        if kind not in (Sdf.ValueTypeNames.Asset, Sdf.ValueTypeNames.AssetArray) or attribute.GetName().startswith(
            "info:"
        ):
            continue
        named = [attribute.Get(time) for time in values.times()]
        if kind == Sdf.ValueTypeNames.AssetArray:
            named = [asset for array in named for asset in array or []]
        layer = attribute.GetPropertyStack()[0].layer if attribute.GetPropertyStack() else None
        for asset in {asset.path: asset for asset in named if asset is not None and asset.path}.values():
            yield from _asset(attribute, asset, layer)


def _asset(attribute: Usd.Attribute, asset: Sdf.AssetPath, layer: Sdf.Layer | None) -> Iterator[Finding]:
    place = attribute.GetPath()
    found = asset.resolvedPath or (_udim(asset.path, layer) if "<UDIM>" in asset.path else "")
    if not found:
        yield own_finding("AssetMissing", place, asset.path + GONE)
    if ABSOLUTE.match(asset.path):
        yield own_finding("AssetAbsolute", place, f"{asset.path} is no relative path")
    elif asset.resolvedPath and layer and not _is_inside(found, attribute.GetStage().GetRootLayer(), layer):
        yield own_finding("AssetOutside", place, f"{asset.path} lies outside the asset's folder")


def _udim(path: str, layer: Sdf.Layer | None) -> str:
    tiles = UsdShade.UdimUtils.ResolveUdimTilePaths(path, layer) if layer else []
    return str(tiles[0][0]) if tiles else ""


def _is_inside(found: str, root: Sdf.Layer, layer: Sdf.Layer) -> bool:
    """Whether a file lies in the folder (or package) of the stage's root layer, or of the layer that names it."""
    homes = [_home(each.realPath) for each in (root, layer) if each.realPath]
    return not homes or any(_within(found, home) for home in homes)


def _home(layer: str) -> str:
    package = PACKAGED.match(layer)
    if package or layer.endswith(".usdz"):
        return package.group(1) if package else layer
    return os.path.dirname(layer)


def _within(found: str, home: str) -> bool:
    package = PACKAGED.match(found)
    path = os.path.realpath(package.group(1) if package else found)
    return Path(path).is_relative_to(os.path.realpath(home))


def layers(stage: Usd.Stage) -> Iterator[Finding]:
    """No layer of the stage refers to another by an absolute path. That they are there, USD's own validators say."""
    for layer in sorted(stage.GetUsedLayers(), key=lambda layer: str(layer.identifier)):
        if layer == stage.GetSessionLayer():
            continue
        for path in sorted(layer.GetCompositionAssetDependencies()):
            if ABSOLUTE.match(path):
                yield own_finding("AssetAbsolute", layer.GetDisplayName(), f"the layer {path} is no relative path")


def bindings(values: Values) -> Iterator[Finding]:
    """Every bound material is there, and is a material."""
    for name in values.prim.GetAuthoredPropertyNames():
        if not (name == "material:binding" or name.startswith("material:binding:")) or ":collection" in name:
            continue
        for target in values.prim.GetRelationship(name).GetForwardedTargets():
            prim = values.prim.GetStage().GetPrimAtPath(target)
            what = "there is no material" if not prim else "it is no material:"
            if not (prim and prim.IsA(UsdShade.Material)):
                yield own_finding("BindingTarget", values.path.AppendProperty(name), f"{what} {target}")


def connections(values: Values) -> Iterator[Finding]:
    """Every input and output of a shader network is connected to what exists."""
    for attribute in values.prim.GetAuthoredAttributes():
        if not attribute.HasAuthoredConnections():
            continue
        for source in attribute.GetConnections():
            if not values.prim.GetStage().GetPropertyAtPath(source):
                yield own_finding(
                    "ConnectionTarget", attribute.GetPath(), f"is connected to {source}, which is not there"
                )
