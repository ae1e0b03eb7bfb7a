"""Blender as a stranger reads what bends a tree: `python blender_bends.py tree.usda out.npz FRAME...`.

Runs in Blender's own Python. Writes the branches' points in each frame and their wind attributes, and tells
in one line of JSON what it found of armatures and curves.
"""

import json
import sys

import bpy
import numpy as np


def attribute(data: bpy.types.Attribute) -> np.ndarray:
    """The values of an attribute, a row each."""
    name, width, kind = {
        "FLOAT": ("value", 1, np.float32),
        "INT": ("value", 1, np.int32),
        "FLOAT_VECTOR": ("vector", 3, np.float32),
    }[data.data_type]
    values = np.zeros(width * len(data.data), kind)
    data.data.foreach_get(name, values)
    return values.reshape(len(data.data), -1).squeeze(axis=1) if width == 1 else values.reshape(-1, width)


def points(frame: int) -> np.ndarray:
    """The branches' points as bent in a frame."""
    bpy.context.scene.frame_set(frame)
    mesh = bpy.data.objects["branches"].evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    xyz = np.zeros(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", xyz)
    return xyz.reshape(-1, 3)


def main(path: str, out: str, *frames: str) -> None:
    """Import the stage and note what is there."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=path, set_frame_range=True, import_guide=True)
    wood = bpy.data.objects["branches"]
    kept = {a.name: attribute(a) for a in wood.data.attributes if a.name.startswith("wind:")}
    moved = {f"points_{frame}": points(int(frame)) for frame in frames}
    np.savez(out, **{name.replace(":", "_"): value for name, value in kept.items()}, **moved)
    skinned = [o for o in bpy.data.objects if any(m.type == "ARMATURE" for m in o.modifiers)]
    told = {
        "version": bpy.app.version_string,
        "domains": sorted({a.domain for a in wood.data.attributes if a.name.startswith("wind:")}),
        "bones": [len(armature.bones) for armature in bpy.data.armatures],
        "groups": {o.name: len(o.vertex_groups) for o in skinned},
        "frames": [bpy.context.scene.frame_start, bpy.context.scene.frame_end],
        "curves": [len(curves.splines) for curves in bpy.data.curves] + [len(c.curves) for c in bpy.data.hair_curves],
    }
    print(json.dumps(told))


if __name__ == "__main__":
    main(*sys.argv[1:])
