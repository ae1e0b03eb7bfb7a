"""Packages: a stage's files copied whole, and the .usdz archive that readers take without unpacking.

An archive is a zip whose files are stored, not compressed, and begin at multiples of 64 bytes; its first
file is the default layer (usdz specification 1.3).
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping
from pathlib import Path

from pxr import Sdf, UsdUtils

from forestgen.errors import InputError

ALIGNMENT = 64  # bytes
HEADER = 30  # bytes of a file's header in a zip, without its name and extra field
PADDING = 0x1986  # the kind of extra field that USD's own writer pads with
NO_TIME = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip can say


def write_usdz(path: Path, files: Mapping[str, Path]) -> Path:
    """Write an archive of `files`, by their names inside, the default layer first; give `path`.

    The same bytes for the same files.

    Raises:
        OSError: a file could not be read or written.
    """
    start = 0
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED, allowZip64=False) as archive:
        for name, file in files.items():
            entry, data = zipfile.ZipInfo(name, NO_TIME), file.read_bytes()
            entry.create_system = 0  # the same on every machine
            start += HEADER + len(name.encode())
            entry.extra = _padding(start)
            archive.writestr(entry, data)
            start += len(entry.extra) + len(data)
    return path


def _padding(start: int) -> bytes:
    """An extra field that ends at a multiple of ALIGNMENT when it begins `start` bytes into the archive."""
    missing = -start % ALIGNMENT
    if not missing:
        return b""
    if missing < 4:  # its own header takes four
        missing += ALIGNMENT
    return PADDING.to_bytes(2, "little") + (missing - 4).to_bytes(2, "little") + bytes(missing - 4)


def dependencies(root: Path, home: Path) -> list[Path]:
    """Every file that a layer needs, in whatever variant, itself first; relative to the folder `home`.

    Raises:
        InputError: a file is missing, or lies outside `home`.
    """
    layers, assets, missing = UsdUtils.ComputeAllDependencies(Sdf.AssetPath(os.fspath(root)))
    if missing:
        raise InputError(f"{root}: needs {missing[0]}, which is not there; build it again, or bring the file back")
    home = home.resolve()
    found = []
    for file in [Path(layer.realPath) for layer in layers] + [Path(asset) for asset in assets]:
        if not file.resolve().is_relative_to(home):
            raise InputError(f"{root}: needs {file}, which lies outside {home}; an asset must hold all its files")
        found.append(file.resolve().relative_to(home))
    return [found[0], *sorted(set(found[1:]) - {found[0]})]
