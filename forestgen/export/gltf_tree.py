"""One tree in a glTF document: its meshes, surfaces and pictures, stored when first needed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forestgen.export.glb import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, Document
from forestgen.export.places import Places, leaf_places
from forestgen.export.subject import Subject
from forestgen.png import png_bytes
from forestgen.tree.level import Level
from forestgen.tree.model import LeafPrototype, Mesh
from forestgen.tree.srgb import linear_from_srgb
from forestgen.usd.flatten import flat_leaves
from forestgen.usd.geometry import prototype_names
from forestgen.usd.materials import BARK_ROUGHNESS, LEAF_ROUGHNESS, OPACITY_THRESHOLD

INSTANCING = "EXT_mesh_gpu_instancing"
LINEAR, LINEAR_MIPMAP_LINEAR = 9729, 9987
CLAMP_TO_EDGE, REPEAT = 33071, 10497
MOST_POINTS_16 = 65_535  # 65535 itself is no index: it ends strips


@dataclass(frozen=True, eq=False)
class Part:
    """What one node of a level holds: a mesh of the document, and its instances' places in the tree."""

    name: str
    mesh: int
    places: Places | None = None  # once, where the tree is


class GltfTree:
    """A tree whose parts are in a document."""

    def __init__(self, document: Document, tree: Subject, instancing: bool) -> None:
        self.document, self.tree = document, tree
        self.levels = [self._parts(level, instancing) for level in tree.levels]
        self._extensions: dict[Part, dict[str, Any]] = {}

    @property
    def provenance(self) -> dict[str, Any]:
        """What the USD asset says of itself too."""
        model = self.tree.model
        return {"method": model.method, "seed": model.seed, "height": float(model.height)}

    def extensions(self, part: Part) -> dict[str, Any]:
        """What a node of one of the parts has, wherever the tree stands: its instances."""
        if part.places is None:
            return {}
        if part not in self._extensions:
            self._extensions[part] = {"extensions": instanced(self.document, part.places)}
        return self._extensions[part]

    def _parts(self, level: Level, instancing: bool) -> list[Part]:
        parts = []
        if len(level.mesh.faces):
            parts.append(Part("branches", self._mesh("branches", level.mesh, self._bark)))
        if len(level.leaves) and instancing:
            names = prototype_names(len(level.prototypes))
            every = leaf_places(level.leaves, len(level.prototypes))
            for name, leaf, places in zip(names, level.prototypes, every, strict=True):
                if len(places):
                    parts.append(Part(name, self._mesh(name, leaf, self._leaf), places))
        elif len(level.leaves):
            flat, _ = flat_leaves(level.leaves, level.prototypes)
            parts.append(Part("leaves", self._mesh("leaves", flat, self._leaf)))
        if len(level.cards.faces):
            parts.append(Part("leaf_cards", self._mesh("leaf_cards", level.cards, self._cards)))
        return parts

    def _mesh(self, name: str, mesh: Mesh | LeafPrototype, material: int) -> int:
        """Store triangles; glTF's v runs downward."""
        add = self.document.accessor
        kind = np.uint16 if len(mesh.points) <= MOST_POINTS_16 else np.uint32
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

    @cached_property
    def _bark(self) -> int:
        rgb = self.tree.model.bark.rgb
        if self.tree.has_plain_bark:
            colour = [*linear_from_srgb(rgb[0, 0] / 255).tolist(), 1.0]
            surface: dict[str, Any] = {"baseColorFactor": colour}
        else:
            surface = {"baseColorTexture": {"index": self._texture("bark", rgb, REPEAT)}}
        surface |= {"metallicFactor": 0.0, "roughnessFactor": BARK_ROUGHNESS}
        return self.document.add("materials", name="bark", pbrMetallicRoughness=surface)

    @cached_property
    def _leaf(self) -> int:
        return self._cut_out("leaf", self.tree.model.atlas.rgba)

    @cached_property
    def _cards(self) -> int:
        assert self.tree.card_rgba is not None  # Subject has seen to it
        return self._cut_out("leaf_cards", self.tree.card_rgba)

    def _cut_out(self, name: str, rgba: NDArray[np.uint8]) -> int:
        """A material that is there where its picture's alpha says so."""
        surface = {
            "baseColorTexture": {"index": self._texture(name, rgba, CLAMP_TO_EDGE)},
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

    def _texture(self, name: str, image: NDArray[np.uint8], wrap: int) -> int:
        """A picture (H, W, 3 or 4) inside the file."""
        add = self.document.add
        source = add("images", name=name, mimeType="image/png", bufferView=self.document.view(png_bytes(image)))
        sampler = add("samplers", magFilter=LINEAR, minFilter=LINEAR_MIPMAP_LINEAR, wrapS=wrap, wrapT=wrap)
        return add("textures", name=name, sampler=sampler, source=source)


def instanced(document: Document, places: Places) -> dict[str, Any]:
    """Instances as the extension wants them: sizes along each axis, turns i j k real in normalised shorts."""
    attributes = {
        "TRANSLATION": document.accessor(places.position.astype(np.float32), bounds=True),
        "ROTATION": document.accessor(np.round(places.turn * 32767).astype(np.int16), normalized=True),
        "SCALE": document.accessor(np.repeat(places.size[:, None], 3, axis=1).astype(np.float32)),
    }
    return {INSTANCING: {"attributes": attributes}}
