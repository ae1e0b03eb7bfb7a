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
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forestgen.errors import InputError
from forestgen.export.glb import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, Document
from forestgen.export.leaf_places import by_prototype, flat_leaves
from forestgen.export.subject import Subject, png_bytes, require_target
from forestgen.scene.forest import Forest
from forestgen.staging import install, staging
from forestgen.tree.level import SCREEN_PX, Level
from forestgen.tree.model import LeafPrototype, Leaves, Mesh, TreeModel
from forestgen.usd.geometry import prototype_names
from forestgen.usd.materials import BARK_ROUGHNESS, LEAF_ROUGHNESS, OPACITY_THRESHOLD, linear_from_srgb

INSTANCING, LOD = "EXT_mesh_gpu_instancing", "MSFT_lod"
LINEAR, LINEAR_MIPMAP_LINEAR = 9729, 9987
CLAMP_TO_EDGE, REPEAT = 33071, 10497
MOST_INDEX_16 = 65_534  # 65535 is glTF's end of strip


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
    root = _Tree(document, Subject(model, tuple(levels), card_rgba), instancing).stand({})
    return _write(document, [root], Path(path))


def write_scene_glb(trees: Mapping[str, Subject], forest: Forest, path: Path, *, instancing: bool = True) -> Path:
    """Write a forest as `path`.glb: each tree's meshes, places of leaves and pictures once, and a node for each
    standing and part of it. `trees` are by the forest's prototype names.

    Raises:
        InputError: as `write_glb`; or a tree is missing, or none stands.
        OSError: as `write_glb`.
    """
    missing = sorted({forest.prototypes[k] for k in forest.prototype} - set(trees))
    if missing or not len(forest):
        raise InputError(f"{path}: " + (f"there is no tree {missing[0]!r} to place" if missing else "no tree stands"))
    document = Document()
    made = {name: _Tree(document, tree, instancing) for name, tree in trees.items()}
    roots = []
    for k, name in enumerate(forest.names):
        half, scale = forest.yaw[k] / 2, float(forest.scale[k])
        place = {
            "translation": forest.position[k].tolist(),
            "rotation": [0.0, float(np.sin(half)), 0.0, float(np.cos(half))],
            "scale": [scale, scale, scale],
        }
        roots.append(made[forest.prototypes[forest.prototype[k]]].stand(place, name))
    return _write(document, roots, Path(path))


class _Tree:
    """One tree in a document: its parts are stored when made, its nodes whenever it stands."""

    def __init__(self, document: Document, tree: Subject, instancing: bool) -> None:
        self.document, self.tree = document, tree
        self.parts = [self.level_parts(level, instancing) for level in tree.levels]

    def stand(self, place: dict[str, Any], name: str | None = None) -> int:
        """Add the nodes of one standing, give the index of its root; `place` is its transform."""
        model, levels = self.tree.model, self.tree.levels
        name = name or model.name or "tree"
        groups: list[int] = []
        for k in reversed(range(len(levels))):  # the finest last: it names the others
            suffix = f"_LOD{k}" if k else ""
            children = [self.document.add("nodes", **part | {"name": part["name"] + suffix}) for part in self.parts[k]]
            group: dict[str, Any] = {"name": name + suffix, "children": children, **place}
            if k == 0:
                provenance = {"method": model.method, "seed": model.seed, "height": float(model.height)}
                group["extras"] = {"forestgen": provenance}
                if groups:
                    group["extensions"] = {LOD: {"ids": groups[::-1]}}
                    group["extras"]["MSFT_screencoverage"] = screen_coverage(levels)
            groups.append(self.document.add("nodes", **group))
        return groups[-1]

    def level_parts(self, level: Level, instancing: bool) -> list[dict[str, Any]]:
        """The nodes below a level's own, still without a place in the document."""
        parts = []
        if len(level.mesh.faces):
            parts.append({"name": "branches", "mesh": self.mesh("branches", level.mesh, self.bark())})
        if len(level.leaves) and instancing:
            chosen = by_prototype(level.leaves, len(level.prototypes))
            names = prototype_names(len(level.prototypes))
            for name, leaf, which in zip(names, level.prototypes, chosen, strict=True):
                if len(which):
                    places = {INSTANCING: {"attributes": self.places(level.leaves, which)}}
                    parts.append({"name": name, "mesh": self.mesh(name, leaf, self.leaf()), "extensions": places})
        elif len(level.leaves):
            flat = flat_leaves(level.leaves, level.prototypes)
            parts.append({"name": "leaves", "mesh": self.mesh("leaves", flat, self.leaf())})
        if len(level.cards.faces):
            parts.append({"name": "leaf_cards", "mesh": self.mesh("leaf_cards", level.cards, self.cards())})
        return parts

    def places(self, leaves: Leaves, which: NDArray[np.int64]) -> dict[str, int]:
        """Where the chosen leaves are, as the extension wants it: turns are i j k real in normalised shorts."""
        turn = leaves.orientation[which][:, [1, 2, 3, 0]]
        size = np.repeat(leaves.size[which, None], 3, axis=1)
        return {
            "TRANSLATION": self.document.accessor(leaves.position[which].astype(np.float32), bounds=True),
            "ROTATION": self.document.accessor(np.round(turn * 32767).astype(np.int16), normalized=True),
            "SCALE": self.document.accessor(size.astype(np.float32)),
        }

    def mesh(self, name: str, mesh: Mesh | LeafPrototype, material: int) -> int:
        """Store triangles; glTF's v runs downward."""
        add = self.document.accessor
        kind = np.uint16 if len(mesh.points) <= MOST_INDEX_16 + 1 else np.uint32
        uv = np.column_stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]])
        primitive = {
            "attributes": {
                "POSITION": add(mesh.points.astype(np.float32), target=ARRAY_BUFFER, bounds=True),
                "NORMAL": add(mesh.normals.astype(np.float32), target=ARRAY_BUFFER),
                "TEXCOORD_0": add(uv.astype(np.float32), target=ARRAY_BUFFER),
            },
            "indices": add(mesh.faces.astype(kind).ravel(), target=ELEMENT_ARRAY_BUFFER),
            "material": material,
        }
        return self.document.add("meshes", name=name, primitives=[primitive])

    def bark(self) -> int:
        """The wood's material."""
        rgb = self.tree.model.bark.rgb
        if self.tree.has_plain_bark:
            colour = [*linear_from_srgb(rgb[0, 0] / 255).tolist(), 1.0]
            surface: dict[str, Any] = {"baseColorFactor": colour}
        else:
            surface = {"baseColorTexture": {"index": self.texture("bark", rgb, REPEAT)}}
        surface |= {"metallicFactor": 0.0, "roughnessFactor": BARK_ROUGHNESS}
        return self.document.add("materials", name="bark", pbrMetallicRoughness=surface)

    def leaf(self) -> int:
        """The leaves' material."""
        return self.cut_out("leaf", self.tree.model.atlas.rgba)

    def cards(self) -> int:
        """The cards' material."""
        assert self.tree.card_rgba is not None  # Subject has seen to it
        return self.cut_out("leaf_cards", self.tree.card_rgba)

    def cut_out(self, name: str, rgba: NDArray[np.uint8]) -> int:
        """A material that is there where its picture's alpha says so."""
        surface = {
            "baseColorTexture": {"index": self.texture(name, rgba, CLAMP_TO_EDGE)},
            "metallicFactor": 0.0,
            "roughnessFactor": LEAF_ROUGHNESS,
        }
        return self.document.add(
            "materials",
            name=name,
            pbrMetallicRoughness=surface,
            alphaMode="MASK",
            alphaCutoff=OPACITY_THRESHOLD,
            doubleSided=True,
        )

    def texture(self, name: str, image: NDArray[np.uint8], wrap: int) -> int:
        """A picture (H, W, 3 or 4) inside the file."""
        add = self.document.add
        view = self.document.view(png_bytes(image))
        source = add("images", name=name, mimeType="image/png", bufferView=view)
        sampler = add("samplers", magFilter=LINEAR, minFilter=LINEAR_MIPMAP_LINEAR, wrapS=wrap, wrapT=wrap)
        return add("textures", name=name, sampler=sampler, source=source)


def screen_coverage(levels: Sequence[Level]) -> list[float]:
    """For each level the size on the screen below which the next takes over; the last is never left.

    As shares of the screen's rows: the extension does not say shares of what, and UnityGLTF reads heights.
    """
    return [*(level.switch_px / SCREEN_PX for level in levels[1:]), 0.0]


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
