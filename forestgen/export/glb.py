"""glTF binary: the container of one JSON text and one buffer, and what the text says of that buffer.

Khronos glTF 2.0, sections 3.6 (buffers, views, accessors) and 4.4 (GLB). Written out here because
no library would be shorter: they all leave the packing of arrays to the caller.
"""

from __future__ import annotations

import hashlib
import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
COMPONENT = {"int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
TYPE = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class Document:
    """A glTF document that grows: arrays and pictures go in, their indices come out.

    The same bytes given twice are stored once.
    """

    def __init__(self) -> None:
        self.json: dict[str, list[Any]] = {}
        self._chunks: list[bytes] = []
        self._length = 0
        self._known: dict[str, int] = {}

    def add(self, kind: str, **entry: Any) -> int:
        """Append an object to one of the document's lists; one that is there already is not repeated."""
        text = f"{kind} {json.dumps(entry)}"
        if kind == "nodes" or text not in self._known:  # a node stands in one place of the tree of nodes only
            self.json.setdefault(kind, []).append(entry)
            self._known[text] = len(self.json[kind]) - 1
        return self._known[text]

    def accessor(
        self, array: NDArray[Any], *, target: int | None = None, bounds: bool = False, normalized: bool = False
    ) -> int:
        """Store an array (N,) or (N, 2 to 4) of one of glTF's types, rows a multiple of four bytes where it is
        a vertex's; with `bounds`, say its least and greatest values."""
        width = 1 if array.ndim == 1 else array.shape[1]
        entry: dict[str, Any] = {
            "bufferView": self.view(np.ascontiguousarray(array).tobytes(), target),
            "componentType": COMPONENT[array.dtype.name],
            "count": len(array),
            "type": TYPE[width],
        }
        if normalized:
            entry["normalized"] = True
        if bounds:
            entry |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        return self.add("accessors", **entry)

    def view(self, data: bytes, target: int | None = None) -> int:
        """Store bytes, aligned to four; a `target` says what a graphics card is to use them for."""
        key = f"bytes {target} {hashlib.sha256(data).hexdigest()}"
        if key not in self._known:
            entry = {"buffer": 0, "byteOffset": self._length, "byteLength": len(data)}
            if target is not None:
                entry["target"] = target
            self._known[key] = self.add("bufferViews", **entry)
            padding = -len(data) % 4
            self._chunks += [data, bytes(padding)]
            self._length += len(data) + padding
        return self._known[key]

    def glb(self, **top: Any) -> bytes:
        """The whole file; `top` are the document's single values, as `asset` and `scene`."""
        buffers = {"buffers": [{"byteLength": self._length}]} if self._length else {}
        whole = {**top, **self.json, **buffers}
        text = json.dumps(whole, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        binary = b"".join(self._chunks)
        size = 12 + 8 + len(text) + 8 + len(binary)
        header = struct.pack("<4sII", b"glTF", 2, size) + struct.pack("<I4s", len(text), b"JSON")
        return b"".join([header, text, struct.pack("<I4s", len(binary), b"BIN\0"), binary])
