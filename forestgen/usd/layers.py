"""Layers: new ones with our conventions, and saving that never fails unseen."""

from __future__ import annotations

import os
from pathlib import Path

from pxr import Sdf, Tf, Usd, UsdGeom

from forestgen.errors import InputError


def require_prim_name(name: str) -> None:
    """Refuse a name that USD would refuse.

    Raises:
        ValueError: `name` is no ASCII identifier.
    """
    if not (name.isascii() and Sdf.Path.IsValidIdentifier(name)):
        raise ValueError(f"{name!r} is no prim name; expected ASCII letters, digits and _, not starting with a digit")


def new_stage(root: str) -> Usd.Stage:
    """Open an empty stage in memory, in metres with Y up; `root` becomes the name of its default prim.

    Nothing that it points to is ever opened: references and payloads are only written down.
    """
    layer = Sdf.Layer.CreateAnonymous(f"{root}.usda")
    stage = Usd.Stage.Open(layer, Usd.Stage.LoadNone)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    layer.defaultPrim = root
    return stage


def reason(error: Tf.ErrorException) -> str:
    """USD's first complaint in words, without its source lines."""
    return str(error.args[0].commentary) if error.args else str(error)


def save(layer: Sdf.Layer, path: Path) -> Path:
    """Write a layer to `path`, text or binary by its ending. A file that could not be written whole is removed.

    Raises:
        OSError: disk full, no such folder, no right to write.
    """
    try:
        is_written, why = layer.Export(os.fspath(path)), "USD gave no reason"
    except Tf.ErrorException as error:
        is_written, why = False, reason(error)
    if not is_written:
        path.unlink(missing_ok=True)
        raise OSError(f"{path} could not be written: {why}")
    return path


def open_stage(path: Path) -> Usd.Stage:
    """Open a stage as it is on disk now, all payloads loaded.

    Raises:
        InputError: there is no such file, or it is no USD.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; expected a USD stage")
    try:
        stage = Usd.Stage.Open(os.fspath(path), Usd.Stage.LoadAll)
        stage.Reload()  # a layer of the same path may still be held from before it was written anew
    except Tf.ErrorException as error:
        raise InputError(f"{path}: cannot be opened as USD: {reason(error)}") from error
    return stage


def relative(target: Path, folder: Path) -> str:
    """The asset path that leads from a layer in `folder` to `target`: always relative, always with `/`."""
    path = Path(os.path.relpath(target, folder)).as_posix()
    return path if path.startswith("../") else f"./{path}"
