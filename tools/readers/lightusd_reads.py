"""lightusd as a stranger reads an asset: `python lightusd_reads.py FILE [SET=VARIANT ...]`.

Prints one line of JSON: each mesh and each point instancer that is active, by path, with counts, sums and bounds of
what it stores; and where each Xform stands. Instances of one prototype share what is below the first of them.
"""

import json
import sys

import lightusd
import numpy as np

ARRAYS = {
    "Mesh": ("points", "normals", "faceVertexIndices", "faceVertexCounts"),
    "PointInstancer": ("positions", "scales", "protoIndices"),
}


def main(path: str, chosen: dict[str, str]) -> None:
    """Read the stage, prim by prim."""
    stage = lightusd.load(path, variants=chosen or None)
    found: dict[str, object] = {}
    places: dict[str, object] = {}
    waiting = list(stage.root_prims)
    while waiting:
        prim = waiting.pop()
        if prim.specifier != "def" or not prim.active:
            continue
        waiting += prim.children
        if prim.type_name == "Xform":
            places[prim.path] = np.array(prim.world_transform()).tolist()
        if prim.type_name in ARRAYS:
            found[prim.path] = {name: told(prim.attribute(name).get()) for name in ARRAYS[prim.type_name]}
    answer = {
        "reader": f"lightusd {lightusd.__version__}",
        "up": stage.up_axis,
        "metres": stage.meters_per_unit,
        "default": stage.default_prim_path,
        "prims": found,
        "places": places,
        "materials": sorted(prim.path for prim in stage.prims_of_type("Material")),
        "warnings": stage.warnings(),
    }
    print(json.dumps(answer))


def told(value: object) -> dict[str, object]:
    """Length, sum and bounds of an array of numbers or vectors."""
    array = np.asarray(lightusd.asarray(value), float)
    array = array.reshape(len(array), -1)
    low, high = (array.min(axis=0).tolist(), array.max(axis=0).tolist()) if len(array) else ([], [])
    return {"n": len(array), "sum": array.sum(axis=0).tolist(), "low": low, "high": high}


if __name__ == "__main__":
    main(sys.argv[1], dict(pair.split("=") for pair in sys.argv[2:]))
