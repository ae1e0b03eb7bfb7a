"""A scene folder to load from: photos, stroke sets, and a manifest that a test writes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from forestgen.tree.methods import METHODS
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import Strategy
from forestgen.tree.view import View
from tests.scene.manifests import MANY_VIEWS


@dataclass(frozen=True, kw_only=True)
class LiftOfMany(Strategy):
    """A lifter that takes any number of views; no test of this folder builds with it."""

    def __call__(self, views: Sequence[View], *, rng: np.random.Generator) -> Skeleton:
        raise NotImplementedError


@pytest.fixture(autouse=True)
def method_of_many_views(monkeypatch: pytest.MonkeyPatch) -> None:
    """A method that takes more than one photo of a tree, whatever the others take."""
    monkeypatch.setitem(METHODS, MANY_VIEWS, replace(METHODS["tan2008_paper"], lift=LiftOfMany()))


@pytest.fixture
def place_of_scene(tmp_path: Path) -> Path:
    """A project with scenes/street/photos and stroke_sets/street; gives the folder scenes/street."""
    folder = tmp_path / "project" / "scenes" / "street"
    strokes = tmp_path / "project" / "stroke_sets" / "street"
    (folder / "photos").mkdir(parents=True)
    strokes.mkdir(parents=True)
    for name in ("plane", "oak_front", "oak_side"):
        Image.fromarray(np.full((80, 100, 3), 99, np.uint8)).save(folder / "photos" / f"{name}.png")
        content = {
            "version": 1,
            "size": [100, 80],
            "crown": [[30, 10], [70, 10], [70, 50], [30, 50]],
            "branches": [[[50, 75], [50, 30]]],
        }
        (strokes / f"{name}.json").write_text(json.dumps(content))
    return folder
