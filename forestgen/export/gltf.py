"""Trees as glTF binary: wood, leaves as instances, levels of detail, pictures, all in one file.

    <tree>                  node of the finest level, MSFT_lod to the others, provenance in extras
        branches            mesh
        leaf_00 ...         mesh of one leaf of the atlas, EXT_mesh_gpu_instancing for its places
        leaf_cards          mesh, on the level that has them
    <tree>_LOD1 ...         the same, coarser; in no scene, so that other readers do not draw them

Surfaces are lit (metallic-roughness), as everything else in a scene is: an unlit tree would neither
darken at dusk nor take a shadow. Leaves are cut out (MASK) and seen from both sides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forestgen.errors import InputError
from forestgen.export.glb import Document
from forestgen.export.gltf_tree import INSTANCING, GltfTree, instanced
from forestgen.export.places import Places, standing_places
from forestgen.export.subject import Subject, require_target
from forestgen.scene.forest import Forest
from forestgen.staging import install, staging
from forestgen.tree.level import SCREEN_PX, Level
from forestgen.tree.model import TreeModel

LOD = "MSFT_lod"
MOST_STANDING = 64  # trees with nodes of their own: each costs a reader some seventy draw calls
MOST_INSTANCES = 4_000_000  # in one file, 128 MB


def write_glb(
    model: TreeModel,
    levels: Sequence[Level],
    path: Path,
    *,
    card_rgba: NDArray[np.uint8] | None = None,
    instancing: bool = True,
) -> Path:
    """Write a tree with its levels of detail, finest first, as `path`.glb. Same tree, same bytes.

    Without `instancing` a level's leaves are one mesh, for readers that do not know the extension.

    Raises:
        InputError: a level has nothing to draw or lacks its texture, or `path` is no .glb or a folder.
        OSError: the file could not be written; an earlier one is as it was.
    """
    document = Document()
    tree = GltfTree(document, Subject(model, tuple(levels), card_rgba), instancing)
    return _write(document, [stand(tree, model.name or "tree", {})], Path(path))


def write_scene_glb(trees: Mapping[str, Subject], forest: Forest, path: Path, *, instancing: bool = True) -> Path:
    """Write a forest as `path`.glb; `trees` are by the forest's prototype names. Meshes and pictures are there once.

    Up to MOST_STANDING trees have nodes of their own, with their levels of detail. More are written as instances
    of the parts of their finest level, also those that are no leaves: a reader draws the forest in as many
    calls as one tree of each kind. `instancing` is then about leaves alone.

    Raises:
        InputError: as `write_glb`; or a tree is missing, none stands, or the leaves are too many for one file.
        OSError: as `write_glb`.
    """
    path = Path(path)
    names = [forest.prototypes[k] for k in np.unique(forest.prototype)]
    missing = [name for name in names if name not in trees]
    if missing or not names:
        raise InputError(f"{path}: " + (f"there is no tree {missing[0]!r} to place" if missing else "no tree stands"))
    document = Document()
    if len(forest) > MOST_STANDING:
        kinds = dict(zip(forest.prototypes, standing_places(forest), strict=True))
        _require_few(trees, kinds, path, instancing)
        finest = {name: replace(trees[name], levels=trees[name].levels[:1]) for name in names}
        roots = [stand_together(GltfTree(document, finest[name], instancing), name, kinds[name]) for name in names]
        return _write(document, roots, path)
    made = {name: GltfTree(document, trees[name], instancing) for name in names}
    roots = []
    for k, name in enumerate(forest.names):
        half, scale = forest.yaw[k] / 2, float(forest.scale[k])
        place = {
            "translation": forest.position[k].tolist(),
            "rotation": [0.0, float(np.sin(half)), 0.0, float(np.cos(half))],
            "scale": [scale, scale, scale],
        }
        roots.append(stand(made[forest.prototypes[forest.prototype[k]]], name, place))
    return _write(document, roots, path)


def stand(tree: GltfTree, name: str, place: Mapping[str, Any]) -> int:
    """Add the nodes of one tree with all its levels, give the index of its root; `place` is its transform."""
    document = tree.document
    groups: list[int] = []
    for k in reversed(range(len(tree.levels))):  # the finest last: it names the others
        suffix = f"_LOD{k}" if k else ""
        children = []
        for part in tree.levels[k]:
            children.append(document.add("nodes", name=part.name + suffix, mesh=part.mesh, **tree.extensions(part)))
        group: dict[str, Any] = {"name": name + suffix, "children": children, **place}
        if k == 0:
            group["extras"] = {"forestgen": tree.provenance}
            if groups:
                group["extensions"] = {LOD: {"ids": groups[::-1]}}
                group["extras"]["MSFT_screencoverage"] = screen_coverage(tree.tree.levels)
        groups.append(document.add("nodes", **group))
    return groups[-1]


def stand_together(tree: GltfTree, name: str, standing: Places) -> int:
    """Add the nodes of all standings of one tree's finest level, give the index of their root."""
    children = []
    for part in tree.levels[0]:
        places = standing if part.places is None else standing.of(part.places)
        extensions = instanced(tree.document, places)
        children.append(tree.document.add("nodes", name=part.name, mesh=part.mesh, extensions=extensions))
    return tree.document.add("nodes", name=name, children=children, extras={"forestgen": tree.provenance})


def screen_coverage(levels: Sequence[Level]) -> list[float]:
    """For each level the size on the screen below which the next takes over; the last is never left.

    As shares of the screen's rows: the extension does not say shares of what, and UnityGLTF reads heights.
    """
    return [*(level.switch_px / SCREEN_PX for level in levels[1:]), 0.0]


def _require_few(trees: Mapping[str, Subject], kinds: Mapping[str, Places], path: Path, instancing: bool) -> None:
    """Refuse a forest whose leaves are too many, one by one, for a file."""
    n_leaves = sum(len(places) * len(trees[name].levels[0].leaves) for name, places in kinds.items() if len(places))
    if instancing and n_leaves > MOST_INSTANCES:
        raise InputError(
            f"{path}: {n_leaves:,} leaves are too many for one file (at most {MOST_INSTANCES:,});"
            " export a coarser level of detail, such as that of cards, or leaves as meshes (no instancing)"
        )


def _write(document: Document, roots: list[int], path: Path) -> Path:
    """Write a document whose scene is these nodes, and say which extensions it uses.

    Who does not know the instances would draw one giant leaf of each kind: so they are required
    (https://github.com/KhronosGroup/glTF/pull/2405); levels are an offer.
    """
    require_target(path, ".glb")
    used = sorted({name for node in document.json["nodes"] for name in node.get("extensions", {})})
    top: dict[str, Any] = {"asset": {"version": "2.0", "generator": "forestgen"}}
    if used:
        top["extensionsUsed"] = used
    if INSTANCING in used:
        top["extensionsRequired"] = [INSTANCING]
    data = document.glb(**top, scene=0, scenes=[{"nodes": roots}])
    with staging(path.parent) as work:
        (work / path.name).write_bytes(data)
        install(work, path.parent, [path.name])
    return path
