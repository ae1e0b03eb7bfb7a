"""Storm, USD's own renderer, draws our cards where it draws the tree."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from forestgen.usd.card_textures import AXES
from tests.readers.strangers import iou, run
from tests.usd.test_card_textures import with_cards


@pytest.mark.gl
def test_cards_stand_in_for_the_tree_before_every_face(tmp_path: Path) -> None:
    path = with_cards(tmp_path, n_leaves=800, longest=512)
    shown = {}
    for mode in ("default", "cards"):
        folder = tmp_path / mode
        folder.mkdir()
        run("bpy", "storm_cards.py", path, mode, folder)
        pictures = {face: cv2.imread(str(folder / f"{face}.png"), cv2.IMREAD_UNCHANGED) for face in AXES}
        shown[mode] = {face: picture[..., 3] >= 128 for face, picture in pictures.items()}
    for face in AXES:
        tree, cards = shown["default"][face], shown["cards"][face]
        assert iou(tree, cards) >= 0.85, face  # Storm cuts its cards at 0.1: they are a little fatter
        for wrong in (cards[:, ::-1], cards[::-1], cards[::-1, ::-1]):
            assert iou(tree, np.ascontiguousarray(wrong)) < 0.75, face
