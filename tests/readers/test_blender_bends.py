"""Blender keeps the wind data of branches, and bends the rig as UsdSkel does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.limb_tree import limb_tree
from forestgen.tree.model import TreeModel
from forestgen.tree.rig import joint_turns, rig_of, skin_of_leaves, skin_of_mesh
from forestgen.tree.sway import PERIOD, Gust
from forestgen.tree.wind import limb_of_mesh, wind_of
from forestgen.usd.extras import Extras
from forestgen.usd.rig import FPS, write_rig
from forestgen.usd.seams import weld
from forestgen.usd.tree_asset import write_tree_asset
from tests.readers.strangers import ask
from tests.tree.skeletons import random_tree
from tests.tree.test_rig import skinned
from tests.tree.test_wind import leaves_at, model_of

FRAMES = (0, 50)


@pytest.fixture(scope="module")
def model() -> TreeModel:
    skeleton = random_tree(300, rng=np.random.default_rng(5))
    return model_of(skeleton, leaves_at(skeleton.position[30:]))


def test_wind_data_arrive_on_the_points(model: TreeModel, tmp_path: Path) -> None:
    path = write_tree_asset(model, tmp_path / "oak", Extras(wind=True, guides=True))
    answer = ask("bpy", "blender_bends.py", path, tmp_path / "found.npz")
    tree = limb_tree(model.skeleton)
    wind, limb = wind_of(tree), limb_of_mesh(model.mesh, tree)[weld(model.mesh).kept]
    assert answer["domains"] == ["POINT"]
    assert answer["curves"] == [len(tree.limbs)]
    with np.load(tmp_path / "found.npz") as found:
        for name in ("pivot", "axis", "level", "phase", "stiffness"):
            assert_allclose(found[f"wind_{name}"], getattr(wind, name)[limb], atol=1e-6)
        assert_array_equal(found["wind_limb"], limb)


def test_the_rig_is_an_armature_that_sways(model: TreeModel, tmp_path: Path) -> None:
    folder = write_tree_asset(model, tmp_path / "oak").parent
    path = write_rig(model, folder, "oak", most_joints=40, strength=0.4)
    answer = ask("bpy", "blender_bends.py", path, tmp_path / "found.npz", *FRAMES)
    rig = rig_of(limb_tree(model.skeleton), 40)
    assert answer["bones"] == [40]
    carrying = len(np.unique(skin_of_leaves(rig, model.leaves).joint))  # Blender makes groups for joints that do
    assert answer["groups"] == {"branches": 40, "leaves": carrying}
    assert answer["frames"] == [0, PERIOD * FPS]
    skin = skin_of_mesh(rig, model.mesh)
    with np.load(tmp_path / "found.npz") as found:
        for frame in FRAMES:
            wanted = skinned(rig, skin, model.mesh.points, joint_turns(rig, Gust(frame / FPS, strength=0.4)))
            assert_allclose(found[f"points_{frame}"], wanted[weld(model.mesh).kept], atol=1e-4)
