"""View: all that is known of one tree from one photo."""

from __future__ import annotations

from dataclasses import dataclass

from forestgen.camera import Camera
from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.strokes import Strokes


@dataclass(frozen=True, eq=False)
class View:
    """A photo of the tree, its strokes, what was found in it, and the camera that took it."""

    photo: Photo
    strokes: Strokes
    mattes: Mattes
    branches: BranchGraph
    camera: Camera

    def __post_init__(self) -> None:
        sizes = {self.photo.size, self.camera.size, self.mattes.foliage.shape[::-1]}
        if len(sizes) != 1:
            raise ValueError(f"View: photo, camera and mattes differ in size: {sorted(sizes)}")
