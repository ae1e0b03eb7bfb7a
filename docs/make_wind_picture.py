"""Make the picture of docs/wind.md: `python docs/make_wind_picture.py out/garden/trees/oak_summer docs`.

From the left: the tree as written, in a breeze, in a storm; bent by the numpy shader `sway` from its wind data alone.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.render import Drawable, Studio, frame_camera
from forestgen.tree.limb_tree import limb_tree
from forestgen.tree.model import TreeModel
from forestgen.tree.sway import Gust, sway
from forestgen.tree.wind import wind_of
from forestgen.usd.read import read_drawables
from forestgen.usd.read_model import read_model
from forestgen.usd.tree_asset import write_tree_asset

GUSTS = (None, Gust(time=1.0, strength=0.15), Gust(time=1.0, strength=0.45))
SIZE = (460, 520)
PAPER = (0.97, 0.97, 0.96)


def drawn(model: TreeModel) -> list[Drawable]:
    """A tree as it would be read from disk."""
    with TemporaryDirectory() as folder:
        return read_drawables(write_tree_asset(model, Path(folder) / "tree"))


def main(tree: Path, folder: Path) -> None:
    """Write folder/wind.jpg."""
    model = replace(read_model(tree), name="tree")
    wind = wind_of(limb_tree(model.skeleton))
    trees = [drawn(model if gust is None else sway(model, wind, gust)) for gust in GUSTS]
    camera = frame_camera(trees[0], azimuth=0.0, size=SIZE, margin=0.07)
    pictures: list[NDArray[np.float32]] = []
    for drawables in trees:
        with Studio(drawables) as studio:
            rgba = studio.lit(camera)
        pictures.append(rgba[..., :3] + (1 - rgba[..., 3:]) * np.array(PAPER, np.float32))
    row = np.round(np.clip(np.hstack(pictures), 0, 1) * 255).astype(np.uint8)
    if not cv2.imwrite(str(folder / "wind.jpg"), row[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88]):
        raise OSError(f"{folder / 'wind.jpg'} could not be written")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
