"""Manifests as tests write them: the whole format, one tree, and one tree with a line changed."""

from __future__ import annotations

from pathlib import Path

from forestgen.scene.manifest import Scene, load_scene

MANY_VIEWS = "many_views"  # a method of the tests, see conftest.py

TREE = """
[[tree]]
name = "plane_01"
height = 11.5
photo = "photos/plane.png"
strokes = "../../stroke_sets/street/plane.json"
"""

WHOLE = """
[scene]
name = "street"
seed = 7
method = "tan2008"
[scene.gates]
skill = 0.4
boundary_f = 0.8
""" + TREE + """
position = [1, 0.0, -2.5]
heading = 90
[tree.settings.grow]
iterations = 150
[tree.gates]
skill = 0.3

[[tree]]
name = "Eiche 🌳"
method = "many_views"
height = 9
seed = 99
[[tree.view]]
photo = "photos/oak_front.png"
strokes = "../../stroke_sets/street/oak_front.json"
[[tree.view]]
photo = "photos/oak_side.png"
strokes = "../../stroke_sets/street/oak_side.json"
azimuth = 90
elevation = -5.0
scale = 1.1
root = [50, 76.5]
focal_px = 1400

[[copy]]
of = "plane_01"
position = [8.0, 0.0, 0.0]
heading = 120.0
scale = 0.9
"""  # fmt: skip

HEAD = '[scene]\nname = "street"\n'


def written(folder: Path, text: str, name: str = "scene.toml") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def load(folder: Path, text: str) -> Scene:
    return load_scene(written(folder, text))


def with_tree(change: str, key: str = "") -> str:
    """A manifest of one tree with a line added, or with that of `key` replaced by it."""
    kept = [line for line in TREE.splitlines() if not (key and line.startswith(key))]
    return "\n".join([HEAD, *kept, change]) + "\n"
