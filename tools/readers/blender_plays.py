"""Blender as a stranger plays a growing tree. Runs in Blender's own Python: `python blender_plays.py growing.usda`."""

import sys

import bpy
import numpy as np

AGES = (0.0, 0.33, 0.66, 1.0)


def main(path: str) -> None:
    """Import the stage, and look at some frames of it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=path, set_frame_range=True, import_cameras=False)
    scene = bpy.context.scene
    assert scene.frame_end > scene.frame_start, "the stage's time codes did not become the frame range"
    heights, leaves, points = [], [], set()
    for age in AGES:
        scene.frame_set(round(scene.frame_start + age * (scene.frame_end - scene.frame_start)))
        depsgraph = bpy.context.evaluated_depsgraph_get()
        mesh = bpy.data.objects["branches"].evaluated_get(depsgraph).to_mesh()
        xyz = np.zeros(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", xyz)
        heights.append(float(xyz.reshape(-1, 3)[:, 1].max()))
        points.add(len(mesh.vertices))
        matrices = np.array([np.array(one.matrix_world) for one in depsgraph.object_instances if one.is_instance])
        leaves.append(int((np.linalg.norm(matrices[:, :3, 1], axis=1) > 1e-4).sum()))
    print(f"Blender {bpy.app.version_string}: heights {np.round(heights, 2)} m, leaves {leaves}, points {points}")
    assert len(points) == 1, "the mesh changed its points"
    assert all(np.diff(heights) > 0), "the wood does not grow"
    assert leaves[0] == 0, "a seed bears leaves"
    assert all(np.diff(leaves) > 0), "leaves do not come"


if __name__ == "__main__":
    main(sys.argv[1])
