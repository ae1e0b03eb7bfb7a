"""tinyusdz as a stranger reads one layer or package: `python tinyusdz_reads.py FILE`.

tinyusdz 0.9.4 does not compose: it shows the layer as written, no payload, reference or variant applied. Prints one
line of JSON: each mesh and point instancer of the layer, by path, with counts, sums and bounds of what it stores; and
what its render scene (Tydra) holds, or why there is none.
"""

import json
import os
import re
import sys

import numpy as np
import tinyusdz

ARRAYS = {
    "Mesh": ("points", "normals", "faceVertexIndices", "faceVertexCounts"),
    "PointInstancer": ("positions", "scales", "protoIndices"),
}


def main(path: str) -> None:
    """Read the layer, prim by prim."""
    real = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # Tydra talks on the standard output
    stage = tinyusdz.load(path)
    found: dict[str, object] = {}
    materials: list[str] = []

    def visit(prim: tinyusdz.Prim, at: str, depth: int) -> bool:
        if prim.type_name in ARRAYS:
            found[at] = {name: told(array(prim, name)) for name in ARRAYS[prim.type_name]}
        if prim.type_name == "Material":
            materials.append(at)
        return True

    stage.visit_prims(visit)
    answer = {
        "reader": "tinyusdz 0.9.4",
        "up": stage.get_metadata("upAxis"),
        "metres": stage.get_metadata("metersPerUnit"),
        "default": stage.get_metadata("defaultPrim"),
        "prims": found,
        "materials": sorted(materials),
        "drawn": drawn(stage),
    }
    real.write(json.dumps(answer) + "\n")


def array(prim: tinyusdz.Prim, name: str) -> np.ndarray:
    """The values of an attribute; an instancer's are to be had as text only."""
    attribute = prim.get_attribute(name)
    if attribute is not None:
        return np.asarray(memoryview(attribute.value)).astype(float)
    text = re.search(rf"\b{name} = \[(.*?)\]", prim.to_string(), re.DOTALL)[1]
    numbers = np.array(re.findall(r"[-+.\deE]+", text), float)
    return numbers.reshape(-1, 3) if "(" in text else numbers


def told(array: np.ndarray) -> dict[str, object]:
    """Length, sum and bounds of an array of numbers or vectors."""
    array = array.reshape(len(array), -1)
    low, high = (array.min(axis=0).tolist(), array.max(axis=0).tolist()) if len(array) else ([], [])
    return {"n": len(array), "sum": array.sum(axis=0).tolist(), "low": low, "high": high}


def drawn(stage: tinyusdz.Stage) -> object:
    """Meshes by path, with their numbers of points, and materials of the render scene; or the error."""
    try:
        scene = tinyusdz.tydra.convert_to_render_scene(stage)
    except tinyusdz.UsdError as error:
        return str(error).strip()
    meshes = {mesh.abs_path: len(memoryview(mesh.points)) for mesh in scene.meshes()}
    return {"meshes": meshes, "materials": len(scene.materials()), "images": len(scene.images())}


if __name__ == "__main__":
    main(sys.argv[1])
