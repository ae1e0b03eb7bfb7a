"""forestgen: photographs and a few strokes in, a USD forest out, with a number for how well it matches.

The way of the data:

    Photo + Strokes -> Mattes -> BranchGraph (2-D, px) -> View(s) -> Skeleton (3-D, m) -> grown Skeleton
    -> Skeleton with radius -> Mesh + Leaves = TreeModel -> tree asset (USD) -> Forest -> scene stage (USD)
    -> report

Glossary:

    photo       one photograph, sRGB, upright
    strokes     what a person drew over one tree in one photo: crown outline, branch lines
    mattes      how much of each pixel is foliage, and how much is wood
    trace       the visible branches of one photo as a rooted graph in pixels
    view        photo, strokes, mattes, trace and camera of one tree
    skeleton    the branches in metres: node 0 is the root, parents come before their children
    attractor   a point that growth tries to bring wood near to
    atlas       the leaf texture cut from the photo, and the leaf prototypes that use it
    method      one algorithm for each stage; named after the paper that it follows
    envelope    a silhouette with gaps below 2 % of the tree's height closed

Five lines of Python build a scene:

    from pathlib import Path
    from forestgen import build_scene, load_scene
    report = build_scene(load_scene(Path("scenes/street/scene.toml")), Path("out/street"))
    for tree in report["trees"]:
        print(tree["name"], tree["views"][0]["envelope_iou"])
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOME = {
    "Camera": "forestgen.camera",
    "ForestgenError": "forestgen.errors",
    "InputError": "forestgen.errors",
    "METHODS": "forestgen.tree.methods",
    "Photo": "forestgen.tree.photo",
    "RenderError": "forestgen.errors",
    "StageError": "forestgen.errors",
    "Strokes": "forestgen.tree.strokes",
    "build_model": "forestgen.pipeline",
    "build_scene": "forestgen.pipeline",
    "check_output": "forestgen.pipeline",
    "configure": "forestgen.tree.methods",
    "load_photo": "forestgen.tree.photo",
    "load_scene": "forestgen.scene.manifest",
    "load_strokes": "forestgen.tree.strokes",
    "single_tree_scene": "forestgen.scene.manifest",
    "write_tree": "forestgen.pipeline",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used: `import forestgen` alone stays light."""
    if name not in _HOME:
        raise AttributeError(f"module 'forestgen' has no attribute '{name}'")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
