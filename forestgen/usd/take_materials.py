"""Materials taken over from a stage into a layer of its own: the UsdPreviewSurface of each, and its pictures."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pxr import Sdf, Usd

from forestgen.errors import InputError

SURFACE = "outputs:surface"  # the output of every renderer; others (mtlx:surface) are for those that know them
NEW_INPUTS = ("inputs:opacityMode",)  # of UsdPreviewSurface since USD 26: newer than the readers of packages


def flat_materials(stage: Usd.Stage, materials: Iterable[Sdf.Path]) -> Sdf.Layer:
    """A layer that holds the materials at paths of a stage, as composed; paths of files are absolute."""
    mask = Usd.StagePopulationMask(sorted(materials))
    masked = Usd.Stage.OpenMasked(stage.GetRootLayer(), stage.GetSessionLayer(), mask)
    with Usd.EditContext(masked, masked.GetSessionLayer()):
        for prim in masked.Traverse():
            if prim.IsInstance():
                prim.SetInstanceable(False)
    return masked.Flatten(addSourceFileComment=False)


def take_material(
    source: Sdf.Layer, material: Sdf.Path, target: Sdf.Layer, path: Sdf.Path, *, is_strict: bool = False
) -> None:
    """Copy a material of a flat layer to `path` of another, with nothing but what its surface output reads.

    `is_strict` leaves out inputs that only new readers know.
    """
    Sdf.CreatePrimInLayer(target, path.GetParentPath())
    Sdf.CopySpec(source, material, target, path)
    keep_surface(target.GetPrimAtPath(path), is_strict=is_strict)


def keep_surface(material: Sdf.PrimSpec, *, is_strict: bool = False) -> None:
    """Take away from a material all nodes, inputs and outputs that its surface output does not read.

    Raises:
        InputError: it has no such output, so no UsdPreviewSurface.
    """
    if SURFACE not in material.properties:
        raise InputError(f"{material.path}: has no {SURFACE}, so nothing that every reader draws: build the tree again")
    layer = material.layer
    nodes: set[Sdf.Path] = set()
    read: set[Sdf.Path] = set()
    waiting = [material.path.AppendProperty(SURFACE)]
    while waiting:
        attribute = layer.GetAttributeAtPath(waiting.pop())
        if attribute is None or attribute.path in read:
            continue
        read.add(attribute.path)
        for source in attribute.connectionPathList.GetAddedOrExplicitItems():
            node = layer.GetPrimAtPath(source.GetPrimPath())
            if node == material:
                waiting.append(source)
            elif node:
                nodes.add(node.path)
                waiting += [one.path for one in node.attributes]
    for name in list(material.properties.keys()):
        if name.startswith(("inputs:", "outputs:")) and material.path.AppendProperty(name) not in read:
            material.RemoveProperty(material.properties[name])
    for child in list(material.nameChildren):
        if not any(path.HasPrefix(child.path) for path in nodes):
            del material.nameChildren[child.name]
    if is_strict:
        for path in sorted(nodes):
            node = layer.GetPrimAtPath(path)
            for name in NEW_INPUTS:
                if name in node.properties:
                    node.RemoveProperty(node.properties[name])


def move_pictures(layer: Sdf.Layer, root: Sdf.Path, folder: str) -> dict[str, Path]:
    """Make every file named at or below a prim a picture in `folder`, relative to the layer.

    Gives name -> file; pictures of one name and different place get numbers.

    Raises:
        InputError: a picture is missing.
    """
    pictures: dict[str, Path] = {}

    def place(file: Path, where: Sdf.Path) -> str:
        if not file.is_file():
            raise InputError(f"{where}: leads to {file}, which is not there; bring it back, or build the tree again")
        name, k = f"{folder}/{file.name}", 2
        while pictures.get(name, file) != file:
            name, k = f"{folder}/{file.stem}_{k}{file.suffix}", k + 1
        pictures[name] = file
        return name

    def visit(path: Sdf.Path) -> None:
        if not path.IsPropertyPath():
            return
        attribute = layer.GetAttributeAtPath(path)
        if attribute is not None and attribute.typeName == Sdf.ValueTypeNames.Asset and attribute.default:
            attribute.default = Sdf.AssetPath(f"./{place(Path(attribute.default.path), path)}")

    layer.Traverse(root, visit)
    return pictures
