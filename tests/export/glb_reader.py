"""A reader of glTF binary written from the specification alone, so that it cannot share the writer's errors."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

DTYPE = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Glb:
    """A file's JSON, and its arrays by accessor."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        n, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        assert n % 4 == 0
        self.json: dict[str, Any] = json.loads(data[20 : 20 + n])
        m, kind = struct.unpack_from("<I4s", data, 20 + n)
        assert kind == b"BIN\0"
        assert 28 + n + m == len(data)
        self.binary = data[28 + n :]
        assert self.json["buffers"] == [{"byteLength": m}]

    def bytes(self, view: int) -> bytes:
        entry = self.json["bufferViews"][view]
        assert entry["byteOffset"] % 4 == 0
        assert entry["byteOffset"] + entry["byteLength"] <= len(self.binary)
        return self.binary[entry["byteOffset"] : entry["byteOffset"] + entry["byteLength"]]

    def array(self, accessor: int) -> NDArray[np.float64]:
        """An accessor's values (N, width), normalised integers as the fractions they mean."""
        entry = self.json["accessors"][accessor]
        width = WIDTH[entry["type"]]
        raw = np.frombuffer(self.bytes(entry["bufferView"]), DTYPE[entry["componentType"]])
        assert len(raw) == entry["count"] * width
        values = raw.reshape(-1, width).astype(float)
        for name, found in (("min", values.min(axis=0)), ("max", values.max(axis=0))):
            assert entry.get(name, found.tolist()) == found.tolist()
        return np.maximum(values / np.iinfo(raw.dtype).max, -1) if entry.get("normalized") else values

    def primitive(self, mesh: int) -> dict[str, NDArray[np.float64]]:
        """A mesh's only primitive: its attributes, and triangles as `faces` (F, 3)."""
        (only,) = self.json["meshes"][mesh]["primitives"]
        found = {name: self.array(k) for name, k in only["attributes"].items()}
        found["faces"] = self.array(only["indices"]).reshape(-1, 3).astype(int)
        return found

    def image(self, material: int, factor: str = "baseColorTexture") -> NDArray[np.uint8]:
        """A material's picture, RGB or RGBA."""
        texture = self.json["textures"][self.json["materials"][material]["pbrMetallicRoughness"][factor]["index"]]
        data = self.bytes(self.json["images"][texture["source"]]["bufferView"])
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        assert picture is not None
        return np.asarray(picture[..., [2, 1, 0, 3][: picture.shape[2]]], np.uint8)

    def node(self, name: str) -> dict[str, Any]:
        """The only node of a name."""
        (only,) = (node for node in self.json["nodes"] if node["name"] == name)
        return only  # type: ignore[no-any-return]

    def material_of(self, node: dict[str, Any]) -> dict[str, Any]:
        material = self.json["meshes"][node["mesh"]]["primitives"][0]["material"]
        return {**self.json["materials"][material], "index": material}
