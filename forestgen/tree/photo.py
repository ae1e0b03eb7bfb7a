"""Photo: one photograph as sRGB, its EXIF orientation applied."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from forestgen.arrays import freeze


@dataclass(frozen=True, eq=False)
class Photo:
    """An image of H rows and W columns."""

    rgb: NDArray[np.uint8]  # (H, W, 3) sRGB
    name: str  # file name, for messages and the report

    def __post_init__(self) -> None:
        freeze(self, rgb=(np.uint8, "H", "W", 3))

    @property
    def size(self) -> tuple[int, int]:
        """(width, height), px."""
        return self.rgb.shape[1], self.rgb.shape[0]


def load_photo(path: Path) -> Photo:
    """Read a photo from a file (hardened by the photo stage's tests)."""
    with Image.open(path) as image:
        return Photo(np.asarray(ImageOps.exif_transpose(image).convert("RGB")), path.name)
