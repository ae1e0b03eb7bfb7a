"""Blender as a stranger reads an asset. Runs in Blender's own Python:

    python blender_reads.py FILE [--cameras CAMERAS.usda --mask OUT.png --size W H] [--frame F]

Prints one line of JSON: objects, instances, triangles, bounds (metres, Y up), materials and missing pictures. With
cameras it also draws, by Cycles and through the first of them, the picture whose alpha says what covers each pixel.
"""

import argparse
import json
import os
from typing import TextIO

import bpy
import numpy as np

TRANSPARENT_BOUNCES = 128  # a ray meets many cut-out leaves
SAMPLES = 16


def main() -> None:
    """Import, count, draw."""
    parser = argparse.ArgumentParser()
    parser.add_argument("file")
    parser.add_argument("--cameras")
    parser.add_argument("--mask")
    parser.add_argument("--size", type=int, nargs=2)
    parser.add_argument("--frame", type=int)
    asked = parser.parse_args()
    json_only = quiet()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=asked.file, import_cameras=False, import_lights=False, set_frame_range=True)
    scene = bpy.context.scene
    if asked.frame is not None:
        scene.frame_set(asked.frame)
    told = {"reader": f"Blender {bpy.app.version_string}", "frames": [scene.frame_start, scene.frame_end], **counts()}
    if asked.mask:
        draw(asked.cameras, asked.mask, asked.size)
    json_only.write(json.dumps(told) + "\n")


def quiet() -> TextIO:
    """Send what Blender prints nowhere; give the standard output as it was."""
    real = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    return real


def counts() -> dict[str, object]:
    """What the import made of the file."""
    kinds: dict[str, int] = {}
    for one in bpy.data.objects:
        kinds[one.type] = kinds.get(one.type, 0) + 1
    triangles, instances, low, high, total = 0, 0, [], [], np.zeros(3)
    known: dict[str, tuple[int, np.ndarray]] = {}
    for item in bpy.context.evaluated_depsgraph_get().object_instances:
        one = item.object
        if one.type != "MESH":
            continue
        if one.name_full not in known:
            mesh = one.data
            mesh.calc_loop_triangles()
            points = np.zeros(3 * len(mesh.vertices), np.float32)
            mesh.vertices.foreach_get("co", points)
            known[one.name_full] = len(mesh.loop_triangles), points.reshape(-1, 3).astype(float)
        n_triangles, points = known[one.name_full]
        matrix = np.array(item.matrix_world)
        at = points @ matrix[:3, :3].T + matrix[:3, 3]
        at = at[:, [0, 2, 1]] * [1, 1, -1]  # Blender's Z up to Y up
        triangles += n_triangles
        instances += item.is_instance
        low.append(at.min(axis=0))
        high.append(at.max(axis=0))
        total += at.sum(axis=0)
    return {
        "objects": kinds,
        "instances": instances,
        "triangles": triangles,
        "bounds": [np.min(low, axis=0).tolist(), np.max(high, axis=0).tolist()],
        "point_sum": total.tolist(),
        "materials": sorted(material.name for material in bpy.data.materials if material.users),
        "images": sorted(image.name for image in bpy.data.images if image.source == "FILE"),
        "missing": sorted(image.filepath for image in bpy.data.images if image.source == "FILE" and not image.size[0]),
        "actions": len(bpy.data.actions),
    }


def draw(cameras: str, mask: str, size: list[int]) -> None:
    """Draw through the first camera of a file, over nothing."""
    bpy.ops.wm.usd_import(filepath=cameras, import_cameras=True, import_materials=False)
    camera = min((one for one in bpy.data.objects if one.type == "CAMERA"), key=lambda one: one.name)
    if camera.data.type == "ORTHO":
        camera.data.ortho_scale /= 10  # the one catch: USD states apertures in tenths of a unit
    scene = bpy.context.scene
    scene.camera = camera
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = SAMPLES
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.filter_width = 1.0
    scene.cycles.max_bounces = 0
    scene.cycles.transparent_max_bounces = TRANSPARENT_BOUNCES
    scene.render.film_transparent = True
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = mask
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
