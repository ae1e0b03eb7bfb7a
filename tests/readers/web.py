"""The strangers of tools/readers: the glTF validator and three.js in a headless Chromium, run from here."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from forestgen.camera import Camera

READERS = Path(__file__).parents[2] / "tools" / "readers"
FINER = 4  # three.js draws so many times the pixels each way, one sample each: as many as our own picture has
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def require(*packages: str, browser: bool = False) -> None:
    """Skip, and say why, where a stranger is absent."""
    if not shutil.which("node"):
        pytest.skip("node is not installed")
    for package in packages:
        if not (READERS / "node_modules" / package).is_dir():
            pytest.skip(f"{package} is not in tools/readers/node_modules: run tools/readers/web.sh once")
    if browser and not any(map(shutil.which, BROWSERS)):
        pytest.skip("no Chromium on the PATH")


def node(script: str, *arguments: Path) -> Any:
    """What a script of tools/readers prints, from JSON."""
    command = ["node", str(READERS / script), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def validate(paths: Sequence[Path]) -> list[dict[str, Any]]:
    """The validator's reports."""
    require("gltf-validator")
    return node("gltf_validates.mjs", *paths)  # type: ignore[no-any-return]


def job(file: Path, camera: Camera, *, look: str = "flat", level: int = 0) -> dict[str, Any]:
    """A file to draw through an orthographic camera of ours, FINER times as finely."""
    assert camera.focal_px is None
    through = {
        "size": [FINER * side for side in camera.size],
        "root_px": [FINER * place for place in camera.root_px],
        "px_per_metre": FINER * camera.px_per_metre,
        "axes": camera.axes.tolist(),
    }
    return {"file": str(file), "camera": through, "look": look, "level": level}


def far_job(file: Path, distance: float, size: tuple[int, int] = (64, 64), fov: float = 50.0) -> dict[str, Any]:
    """A file to draw in perspective from +Z, `distance` metres from the root, through `fov` degrees of height."""
    height = 1.0
    through = {"size": size, "fov": fov, "position": [0, height, distance], "target": [0, height, 0]}
    return {"file": str(file), "camera": through, "look": "outdoors", "level": 0}


def show(jobs: Sequence[dict[str, Any]], folder: Path) -> list[tuple[dict[str, Any], NDArray[np.float64]]]:
    """For each job what three.js counted, and its picture: premultiplied RGBA (H, W, 4) in [0, 1]."""
    require("three", "playwright-core", browser=True)
    pictures = [folder / f"{k:02d}.png" for k in range(len(jobs))]
    plan = folder / "jobs.json"
    plan.write_text(json.dumps([{**one, "picture": str(path)} for one, path in zip(jobs, pictures, strict=True)]))
    found = node("three_shows.mjs", plan)
    return [(counts, _read(path)) for counts, path in zip(found, pictures, strict=True)]


def _read(path: Path) -> NDArray[np.float64]:
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    rgba = np.asarray(picture[..., [2, 1, 0, 3]] / 255.0)
    rgba[..., :3] *= rgba[..., 3:]
    height, width = rgba.shape[:2]
    return rgba.reshape(height // FINER, FINER, width // FINER, FINER, 4).mean(axis=(1, 3))
