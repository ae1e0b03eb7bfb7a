"""Fixtures: one written tree, one bare tree and one written scene, read by many tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from forestgen.scene.forest import Forest
from forestgen.usd.cameras import write_cameras
from forestgen.usd.forest_scene import write_forest
from forestgen.usd.tree_asset import write_tree_asset
from tests.usd.models import tree_model

FOREST = Forest(
    prototypes=("oak", "bare"),
    names=("oak", "bare", "oak_copy"),
    prototype=np.array([0, 1, 0]),
    position=np.array([[1.0, 0.0, 2.0], [7.0, 0.5, 0.0], [-3.0, 0.0, -4.0]]),
    yaw=np.radians([0.0, 40.0, 120.0]),
    scale=np.array([1.0, 1.0, 0.9]),
)


def write_scene(folder: Path) -> Path:
    """Two trees, one with leaves, and a scene of three standings of them."""
    assets, cameras = {}, {}
    for name, n_leaves in (("oak", 50), ("bare", 0)):
        model = tree_model(n_leaves=n_leaves, name=name)
        assets[name] = write_tree_asset(model, folder / "trees" / name)
        cameras[name] = write_cameras(model, folder / "trees" / name)
    return write_forest(FOREST, assets, cameras, folder / "wood.usda", "wood")


@pytest.fixture(scope="session")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A written scene; not to be changed."""
    return write_scene(tmp_path_factory.mktemp("wald ü 树"))  # USD and textures must bear any folder


@pytest.fixture(scope="session")
def oak(scene: Path) -> Path:
    """The written component with leaves."""
    return scene.parent / "trees" / "oak" / "oak.usda"


@pytest.fixture(scope="session")
def bare(scene: Path) -> Path:
    """The written component without leaves."""
    return scene.parent / "trees" / "bare" / "bare.usda"
