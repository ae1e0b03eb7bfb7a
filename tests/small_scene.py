"""A scene of small drawn trees on disk: quick to build, with manifests that can be varied."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import cv2
import numpy as np

from tests.synthetic import drawn_tree

# A few iterations will do: these tests are about files and processes, not about looks.
QUICK = "[tree.settings.grow]\niterations = 3\n"


def write_inputs(folder: Path, *, px_per_metre: float = 40.0) -> Path:
    """Write photo.png, strokes.json, and strokes that no tree stands in; returns the folder."""
    tree = drawn_tree(px_per_metre=px_per_metre)
    folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / "photo.png"), np.ascontiguousarray(tree.photo.rgb[..., ::-1]))
    strokes = {
        "version": 1,
        "photo": "photo.png",
        "size": list(tree.photo.size),
        "crown": tree.strokes.crown.tolist(),
        "branches": [path.tolist() for path in tree.strokes.branches],
    }
    (folder / "strokes.json").write_text(json.dumps(strokes))
    return folder


def write_scene(folder: Path, *names: str, seed: int = 7, extra: str = "") -> Path:
    """Write a manifest of trees of these names, four metres apart; returns its path."""
    if not (folder / "photo.png").is_file():
        write_inputs(folder)
    text = f'[scene]\nname = "small"\nseed = {seed}\n'
    for k, name in enumerate(names):
        text += f"[[tree]]\nname = {json.dumps(name)}\nheight = 5.5\nposition = [{4 * k}, 0, 0]\n"
        text += f'photo = "photo.png"\nstrokes = "strokes.json"\n{QUICK}'
    path = folder / "scene.toml"
    path.write_text(text + extra, encoding="utf-8")
    return path


def digests(folder: Path) -> dict[str, str]:
    """Each file below a folder, hidden ones too, with a digest of its bytes."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def defeating_strokes(folder: Path) -> str:
    """Write a stroke set whose crown leaves no background in the photo: a stage gives up. Returns its name."""
    strokes = json.loads((folder / "strokes.json").read_text())
    width, height = strokes["size"]
    corners = [[0, 0], [width, 0], [width, height], [0, height]]
    (folder / "everywhere.json").write_text(json.dumps({**strokes, "crown": corners}))
    return "everywhere.json"
