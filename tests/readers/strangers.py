"""Programs that nobody here wrote, each run in an environment of its own, and what USD itself says to compare with."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from forestgen.camera import Camera
from forestgen.render import Drawable, Studio

ROOT = Path(__file__).parents[2]
ARRAYS = {
    "Mesh": ("points", "normals", "faceVertexIndices", "faceVertexCounts"),
    "PointInstancer": ("positions", "scales", "protoIndices"),
}
FINER = 2  # our own picture is drawn with so many times the pixels each way: pyrender takes four samples of one


def python_of(name: str) -> Path:
    """The Python of a reader's environment; the test is skipped where there is none."""
    variable = f"FORESTGEN_READER_{name.upper()}"
    python = Path(os.environ.get(variable, ROOT / f".venv-{name}" / "bin" / "python"))
    if not python.is_file():
        pytest.skip(f"no environment with {name}: run `make readers`, or let {variable} name its Python")
    return python


def ask(name: str, script: str, *arguments: object) -> dict[str, Any]:
    """What a script of tools/readers answers: the JSON of its last line."""
    answer: dict[str, Any] = json.loads(run(name, script, *arguments).splitlines()[-1])
    return answer


def run(name: str, script: str, *arguments: object) -> str:
    """What a script of tools/readers prints; it fails where it fails."""
    command = [python_of(name), ROOT / "tools" / "readers" / script, *arguments]
    done = subprocess.run([os.fspath(word) if isinstance(word, Path) else str(word) for word in command],
                          capture_output=True, text=True, timeout=300, check=False)  # fmt: skip
    assert done.returncode == 0, f"{script}: {done.stderr[-2000:]}"
    return done.stdout


def told(value: object) -> dict[str, Any]:
    """Length, sum and bounds of an array of numbers or vectors."""
    array = np.array(value, float)
    array = array.reshape(len(array), -1)
    return {"n": len(array), "sum": array.sum(axis=0), "low": array.min(axis=0), "high": array.max(axis=0)}


def composed(stage: Usd.Stage) -> dict[str, dict[str, Any]]:
    """What the meshes and instancers of a stage store, by path; of several instances of a prototype, the first's."""
    found, first = {}, {}
    for prim in stage.Traverse(Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
        if prim.IsInstance():
            first.setdefault(prim.GetPrototype().GetPath(), prim.GetPath())
        if prim.GetTypeName() not in ARRAYS:
            continue
        owner = next((above for above in _upward(prim) if above.IsInstance()), None)
        if owner is None or first[owner.GetPrototype().GetPath()] == owner.GetPath():
            arrays = ARRAYS[prim.GetTypeName()]
            found[str(prim.GetPath())] = {name: told(prim.GetAttribute(name).Get()) for name in arrays}
    return found


def places(stage: Usd.Stage) -> dict[str, NDArray[np.float64]]:
    """Where each Xform of a stage stands (4, 4), as USD writes matrices; none within instances."""
    cache = UsdGeom.XformCache()
    found = [prim for prim in stage.Traverse() if prim.GetTypeName() == "Xform"]
    return {str(prim.GetPath()): np.array(cache.GetLocalToWorldTransform(prim)) for prim in found}


def _upward(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    while prim:
        yield prim
        prim = prim.GetParent()


def written(layer: Sdf.Layer) -> dict[str, dict[str, Any]]:
    """What the meshes and instancers of one layer store, by path, nothing composed."""
    found: dict[str, dict[str, Any]] = {}

    def visit(at: Sdf.Path) -> None:
        prim = layer.GetPrimAtPath(at) if at.IsPrimPath() else None
        if prim and prim.typeName in ARRAYS:
            found[str(at)] = {name: told(prim.attributes[name].default) for name in ARRAYS[prim.typeName]}

    layer.Traverse(Sdf.Path.absoluteRootPath, visit)
    return found


def assert_agree(theirs: dict[str, Any], ours: dict[str, dict[str, Any]], rtol: float = 1e-6) -> None:
    """Both know the same prims, with the same counts, sums and bounds."""
    assert sorted(theirs) == sorted(ours)
    for path, arrays in ours.items():
        for name, mine in arrays.items():
            yours = theirs[path][name]
            assert yours["n"] == mine["n"], (path, name)
            for key in ("sum", "low", "high"):
                atol = rtol * mine["n"] if key == "sum" else rtol
                np.testing.assert_allclose(yours[key], mine[key], rtol=rtol, atol=atol, err_msg=f"{path} {name} {key}")


def camera_of(path: Path) -> Camera:
    """The first camera of a `cameras.usda`, an orthographic one, as it is written."""
    stage = Usd.Stage.Open(os.fspath(path))
    prim = next(prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera))
    pose = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim)).T
    size = np.array(prim.GetCustomDataByKey("forestgen:size_px"))
    scale = size[0] / (prim.GetAttribute("horizontalAperture").Get() * 0.1)  # pixels a metre
    right, up, back = pose[:3, :3].T
    root = size / 2 - np.array([pose[:3, 3] @ right, pose[:3, 3] @ up]) * scale * [1, -1]
    azimuth, elevation = np.arctan2(back[0], back[2]), np.arcsin(np.clip(back[1], -1, 1))
    return Camera((int(size[0]), int(size[1])), (root[0], root[1]), scale, azimuth, elevation)


def our_mask(drawables: list[Drawable], camera: Camera) -> NDArray[np.bool_]:
    """Where our own renderer draws: pixels (H, W) that are covered from one half on."""
    width, height = camera.size
    finer = Camera(
        (width * FINER, height * FINER),
        (camera.root_px[0] * FINER, camera.root_px[1] * FINER),
        camera.px_per_metre * FINER,
        camera.azimuth,
        camera.elevation,
    )
    with Studio(drawables) as studio:
        share = studio.classes(finer).sum(axis=2)
    return np.asarray(share.reshape(height, FINER, width, FINER).mean(axis=(1, 3)) >= 0.5)


def their_mask(path: Path) -> NDArray[np.bool_]:
    """The same of a picture with alpha."""
    image = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)
    return np.asarray(image[..., 3] >= 128)


def iou(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    """Overlap over union."""
    return float((one & other).sum() / (one | other).sum())
