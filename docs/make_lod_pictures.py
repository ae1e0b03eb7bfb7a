"""Pictures of all levels of detail side by side, at one size and where they switch; run from the checkout's root.

    python docs/make_lod_pictures.py out/street docs/lods oak_winter maple_autumn pine_medium

Reads the named trees of a built scene (all of them where none is named) and writes one JPEG each, <tree>.jpg.
"""

from __future__ import annotations

import sys
from pathlib import Path

from forestgen.check.album import Album
from forestgen.check.lod_sheet import lod_sheet
from forestgen.check.lods import DrawnLevel
from forestgen.usd.lod_drawables import read_lod_drawables


def main(scene: Path, target: Path, *names: str) -> None:
    """Write the pictures of a scene's trees into a folder."""
    album = Album(target, ".")
    for folder in sorted((scene / "trees").iterdir()):
        if folder.is_dir() and (not names or folder.name in names):
            levels = [DrawnLevel(*level) for level in read_lod_drawables(folder / f"{folder.name}.usda")]
            words = f"levels of detail of {folder.name}"
            album.add(folder.name, lod_sheet(levels), words, words)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:])
