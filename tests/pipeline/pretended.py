"""Builds of the small scene, and what pretended trees hold."""

from __future__ import annotations

from pathlib import Path

from forestgen.pipeline import build_scene
from forestgen.scene.manifest import Scene, load_scene
from tests.small_scene import write_scene

BUILT = "pretended tree"


def write_stage(scene: Scene, folder: Path, instancing: str) -> None:
    if instancing == "points":
        (folder / f"{scene.prim_name}_trees.usdc").write_bytes(b"places")
    if scene.trees:
        (folder / f"{scene.prim_name}.usda").write_text(f"#usda 1.0\n# {[tree.name for tree in scene.trees]}\n")


def build(folder: Path, *names: str, seed: int = 7, **options):
    return build_scene(load_scene(write_scene(folder, *names, seed=seed)), folder / "out", **options)
