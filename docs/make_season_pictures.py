"""Make the pictures of docs/seasons-and-looks.md: `python docs/make_season_pictures.py out/street docs/seasons`.

seasons.jpg: trees as written, in each variant of the set `season`. light.jpg: one tree with the photo's own light and
without, as its texture is and under a sun. Prints the table of coverage by mip level.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.render import Studio, frame_camera
from forestgen.render.drawable import Drawable
from forestgen.tree.mips import build_mips
from forestgen.usd.read import read_drawables

Picture = NDArray[np.uint8]
SIZE = 270, 300  # px of one tree
TREES = "oak_summer", "maple_autumn", "cherry_pink", "pine_medium"
SEASONS = "photo", "summer", "autumn", "winter"
SKY = 0.90, 0.93, 0.96


def in_variants(tree: Path, **variants: str) -> list[Drawable]:
    """What a tree's asset shows with these variants selected."""
    chosen = "".join(f'string {name} = "{variant}"\n' for name, variant in variants.items())
    asset = (tree / f"{tree.name}.usda").absolute()
    head = '#usda 1.0\n(\ndefaultPrim = "tree"\nupAxis = "Y"\nmetersPerUnit = 1\n)\n'
    with tempfile.TemporaryDirectory() as folder:
        layer = Path(folder) / "chosen.usda"
        layer.write_text(f'{head}def "tree" (\nreferences = @{asset}@\nvariants = {{\n{chosen}}}\n)\n{{\n}}\n')
        return read_drawables(layer)


def portrait(shown: list[Drawable], frame: list[Drawable], *, is_lit: bool = True) -> Picture:
    """The tree on a pale sky, framed as `frame` would be."""
    camera = frame_camera(frame, azimuth=0.3, size=(2 * SIZE[0], 2 * SIZE[1]), margin=0.04)
    with Studio(shown) as studio:
        rgba = studio.lit(camera) if is_lit else studio.colour(camera)
    picture = np.clip(rgba[..., :3] + np.array(SKY, np.float32) * (1 - rgba[..., 3:]), 0, 1)
    return np.asarray(np.round(255 * cv2.resize(picture, SIZE, interpolation=cv2.INTER_AREA)), np.uint8)


def write(rows: list[list[Picture]], path: Path) -> None:
    """Rows of pictures as one JPEG."""
    picture = np.vstack([np.hstack(row) for row in rows])
    if not cv2.imwrite(str(path), picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 86]):
        raise OSError(f"{path} could not be written")


def main(out: Path, folder: Path) -> None:
    """Write the pictures; print the table."""
    folder.mkdir(parents=True, exist_ok=True)
    trees = [out / "trees" / name for name in TREES]
    rows = []
    for tree in trees:
        whole = in_variants(tree)
        rows.append([portrait(in_variants(tree, season=season), whole) for season in SEASONS])
    write(rows, folder / "seasons.jpg")
    rows = []
    for tree in trees[:2]:
        both = [in_variants(tree, light=light) for light in ("baked", "delit")]
        rows.append([portrait(shown, both[0], is_lit=is_lit) for is_lit in (False, True) for shown in both])
    write(rows, folder / "light.jpg")
    sys.stdout.write(coverage_table(trees[0], trees[3]))


def coverage_table(*trees: Path) -> str:
    """Coverage by mip level of each tree's atlas: plain, kept, and the threshold that keeps it."""
    lines = []
    for tree in trees:
        image = cv2.imread(str(tree / "textures" / "leaf.png"), cv2.IMREAD_UNCHANGED)
        assert image is not None, tree
        mips = build_mips(np.asarray(image[..., [2, 1, 0, 3]], np.uint8))
        columns = zip(mips.kept, mips.plain_coverage, mips.coverage, mips.thresholds, strict=True)
        lines += [f"{tree.name}", "| level | size | plain | kept | threshold |", "| ---: | --- | ---: | ---: | ---: |"]
        for k, (level, plain, kept, threshold) in enumerate(columns):
            size = f"{level.shape[1]} x {level.shape[0]}"
            lines.append(f"| {k} | {size} | {plain:.3f} | {kept:.3f} | {threshold:.3f} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
