"""What a finished tree keeps beside its USD: each view's photo, mattes, trace and camera, and its provenance.

    reference/provenance.json  skeleton.npz
    reference/view_00/photo.png  foliage.png  branch.png  trace.json  strokes.json  view.json

PNGs keep the colours exact. Every path in the files is relative; angles in the files are degrees.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.errors import InputError
from forestgen.png import FAST, write_png
from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.model import TreeModel
from forestgen.tree.photo import Photo
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strokes import DensityStroke, Strokes
from forestgen.tree.view import View

VERSION = 1


@dataclass(frozen=True, eq=False)
class Provenance:
    """How a tree came about: what the report shows and USD does not keep."""

    name: str
    method: str
    seed: int
    height: float  # m
    skeleton: Skeleton
    evergreen: bool
    bark_size: tuple[float, float]  # m, width and height of one repeat of the bark
    costs: Mapping[str, NDArray[np.float64]]  # per growth iteration, by name
    notes: tuple[str, ...]


def write_reference(view: View, folder: Path) -> None:
    """Write one view into `folder`, which is made.

    Raises:
        OSError: a file could not be written whole.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_png(folder / "photo.png", view.photo.rgb, FAST)
    write_png(folder / "foliage.png", _to_bytes(view.mattes.foliage), FAST)
    write_png(folder / "branch.png", _to_bytes(view.mattes.branch), FAST)
    graph = view.branches
    _write_json(
        folder / "trace.json",
        {
            "version": VERSION,
            "xy": graph.xy.tolist(),
            "parent": graph.parent.tolist(),
            "radius_px": [None if math.isnan(r) else r for r in graph.radius_px.tolist()],
        },
    )
    strokes = view.strokes
    _write_json(
        folder / "strokes.json",
        {
            "version": VERSION,
            "photo": "photo.png",
            "size": list(view.photo.size),
            "crown": strokes.crown.tolist(),
            "branches": [path.tolist() for path in strokes.branches],
            "background": [path.tolist() for path in strokes.background],
            "density": [{"add": s.add, "radius": s.radius_px, "path": s.path.tolist()} for s in strokes.density],
        },
    )
    camera = view.camera
    _write_json(
        folder / "view.json",
        {
            "version": VERSION,
            "photo": Path(view.photo.name).name,
            "size": list(camera.size),
            "root_px": list(camera.root_px),
            "px_per_metre": camera.px_per_metre,
            "azimuth": math.degrees(camera.azimuth),
            "elevation": math.degrees(camera.elevation),
            "focal_px": camera.focal_px,
        },
    )


def read_reference(folder: Path) -> View:
    """Read back what `write_reference` wrote.

    Raises:
        InputError: a file is missing or broken.
    """
    view, trace, strokes = (_read_json(folder / f"{name}.json") for name in ("view", "trace", "strokes"))
    rgb = _read_png(folder / "photo.png", cv2.IMREAD_COLOR)[..., ::-1]
    alpha = [_read_png(folder / f"{name}.png", cv2.IMREAD_GRAYSCALE) for name in ("foliage", "branch")]
    try:
        return View(
            photo=Photo(np.ascontiguousarray(rgb), view["photo"]),
            strokes=Strokes(
                crown=np.array(strokes["crown"], float),
                branches=tuple(np.array(path, float) for path in strokes["branches"]),
                background=tuple(np.array(path, float) for path in strokes["background"]),
                density=tuple(
                    DensityStroke(s["add"], s["radius"], np.array(s["path"], float)) for s in strokes["density"]
                ),
                size=(strokes["size"][0], strokes["size"][1]),
                photo=strokes["photo"],
            ),
            mattes=Mattes(*(matte.astype(np.float32) / np.float32(255) for matte in alpha)),
            branches=BranchGraph(
                np.array(trace["xy"], float),
                np.array(trace["parent"], int),
                np.array([np.nan if r is None else r for r in trace["radius_px"]], float),
            ),
            camera=Camera(
                size=(view["size"][0], view["size"][1]),
                root_px=(view["root_px"][0], view["root_px"][1]),
                px_per_metre=view["px_per_metre"],
                azimuth=math.radians(view["azimuth"]),
                elevation=math.radians(view["elevation"]),
                focal_px=view["focal_px"],
            ),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise _broken(folder, error) from error


def write_provenance(model: TreeModel, folder: Path) -> None:
    """Write how a tree came about into `folder`, which is made."""
    folder.mkdir(parents=True, exist_ok=True)
    skeleton = model.skeleton
    with (folder / "skeleton.npz").open("wb") as file:
        np.savez_compressed(file, position=skeleton.position, parent=skeleton.parent, radius=skeleton.radius)
    _write_json(
        folder / "provenance.json",
        {
            "version": VERSION,
            "name": model.name,
            "method": model.method,
            "seed": model.seed,
            "height": model.height,
            "views": len(model.views),
            "evergreen": model.evergreen,
            "bark_size": [model.bark.width_m, model.bark.height_m],
            "costs": {name: [_finite(c) for c in np.asarray(cost).tolist()] for name, cost in model.costs.items()},
            "notes": list(model.notes),
        },
    )


def read_provenance(folder: Path) -> Provenance:
    """Read back what `write_provenance` wrote.

    Raises:
        InputError: a file is missing or broken.
    """
    kept = _read_json(folder / "provenance.json")
    try:
        with (folder / "skeleton.npz").open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            skeleton = Skeleton(arrays["position"], arrays["parent"], arrays["radius"])
        return Provenance(
            name=kept["name"],
            method=kept["method"],
            seed=kept["seed"],
            height=float(kept["height"]),
            skeleton=skeleton,
            evergreen=bool(kept["evergreen"]),
            bark_size=(float(kept["bark_size"][0]), float(kept["bark_size"][1])),
            costs={
                name: np.array([np.nan if c is None else c for c in cost], float)
                for name, cost in kept["costs"].items()
            },
            notes=tuple(kept["notes"]),
        )
    except (OSError, EOFError, LookupError, TypeError, AttributeError, ValueError, BadZipFile) as error:
        raise _broken(folder, error) from error


def read_views(folder: Path) -> list[View]:
    """All views of a tree's `reference` folder, in their order.

    Raises:
        InputError: there is none, or one is broken.
    """
    folders = sorted(folder.glob("view_[0-9]*"))
    if not folders:
        raise InputError(f"{folder}: holds no view; expected view_00: build the tree again")
    return [read_reference(one) for one in folders]


def _to_bytes(alpha: NDArray[np.float32]) -> NDArray[np.uint8]:
    """An alpha matte (H, W) in 256 steps; what is at or above one half stays so, and what is below too."""
    return np.asarray(np.round(alpha * 255), np.uint8)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _read_png(path: Path, mode: int) -> NDArray[np.uint8]:
    try:
        data = np.frombuffer(path.read_bytes(), np.uint8)
    except OSError as error:
        raise _broken(path, error) from error
    image = cv2.imdecode(data, mode) if len(data) else None
    if image is None:
        raise InputError(f"{path}: is not a readable PNG: build the tree again")
    return np.asarray(image, np.uint8)


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, ensure_ascii=False, indent=1), encoding="utf-8")


def _read_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise _broken(path, error) from error


def _broken(path: Path, error: Exception) -> InputError:
    if isinstance(error, FileNotFoundError):
        return InputError(f"{path}: not found: build the tree again")
    return InputError(f"{path}: cannot be read ({type(error).__name__}: {error}): build the tree again")
