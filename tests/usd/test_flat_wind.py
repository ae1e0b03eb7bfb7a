"""Wind data on flattened trees: each point knows the limb that its leaf or its wood knew."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Usd, UsdGeom

from forestgen.tree.level import NO_LEAVES, full_level
from forestgen.tree.limb_tree import limb_tree
from forestgen.tree.model import TreeModel
from forestgen.tree.seasons import Season
from forestgen.tree.wind import limb_of_leaves, limb_of_mesh, wind_of
from forestgen.usd.extras import Extras
from forestgen.usd.flat_wind import read_wind
from forestgen.usd.flatten import flat_leaves
from forestgen.usd.layers import open_stage
from forestgen.usd.profiles import write_profile
from forestgen.usd.seams import weld
from forestgen.usd.seasons import SeasonLook
from forestgen.usd.tree_asset import write_tree_asset
from forestgen.usd.validate import validate
from tests.tree.skeletons import random_tree
from tests.tree.test_wind import leaves_at, model_of
from tests.usd.models import atlas

NAMES = ("pivot", "axis", "level", "phase", "stiffness")
FALLEN = np.array([3, 40])


@pytest.fixture(scope="module")
def model() -> TreeModel:
    """A tree with leaves of two shapes at its twigs."""
    rng = np.random.default_rng(5)
    skeleton = random_tree(300, rng=rng)
    leaves = leaves_at(skeleton.position[30:])
    leaves = replace(leaves, prototype=rng.integers(0, 2, len(leaves)))
    return replace(model_of(skeleton, NO_LEAVES), leaves=leaves, atlas=atlas(2, rng))


@pytest.fixture(scope="module")
def tree(model: TreeModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the tree with wind and, in autumn, two leaves less."""
    looks: dict[Season, SeasonLook] = {"photo": SeasonLook(), "autumn": SeasonLook(fallen={"LOD0": FALLEN})}
    folder = tmp_path_factory.mktemp("trees") / "oak"
    return write_tree_asset(model, folder, Extras(wind=True, seasons=looks)).parent


@pytest.mark.parametrize("season", ["photo", "autumn"])
def test_unreals_mesh_says_of_each_point_what_the_tree_says(
    tree: Path, model: TreeModel, tmp_path: Path, season: str
) -> None:
    path = write_profile(tree, tmp_path / "made", "unreal", variants={"season": season})
    stage = open_stage(path)
    mesh = stage.GetPrimAtPath("/oak/LOD0")
    limbs, wind = limb_tree(model.skeleton), wind_of(limb_tree(model.skeleton))
    kept = np.setdiff1d(np.arange(len(model.leaves)), FALLEN if season == "autumn" else [])
    leaves = model.leaves.take(kept)
    flat, owner = flat_leaves(leaves, full_level(model).prototypes)
    stored = weld(model.mesh).kept
    points = np.array(UsdGeom.Mesh(mesh).GetPointsAttr().Get())
    assert_allclose(points, np.concatenate([model.mesh.points[stored], flat.points]), atol=2e-3)  # turns are halfs
    wanted = np.concatenate([limb_of_mesh(model.mesh, limbs)[stored], limb_of_leaves(leaves, limbs)[owner]])
    api = UsdGeom.PrimvarsAPI(mesh)
    assert_array_equal(api.GetPrimvar("wind:limb").ComputeFlattened(), wanted)
    for name in NAMES:
        assert api.GetPrimvar(f"wind:{name}").GetInterpolation() == UsdGeom.Tokens.vertex
        assert_allclose(
            api.GetPrimvar(f"wind:{name}").ComputeFlattened(), getattr(wind, name)[wanted], atol=1e-6, err_msg=name
        )
    assert_array_equal(read_wind(mesh).parent, wind.parent)  # type: ignore[union-attr]
    assert validate(path) == []
    nvidia = pytest.importorskip("usd_validation_nvidia")
    assert list(nvidia.ValidationEngine().validate(str(path)).issues()) == []


def test_a_tree_without_wind_stays_without(model: TreeModel, tmp_path: Path) -> None:
    tree = write_tree_asset(model, tmp_path / "oak").parent
    stage = open_stage(write_profile(tree, tmp_path / "made", "unreal"))
    mesh = stage.GetPrimAtPath("/oak/LOD0")
    assert not [name for name in mesh.GetPropertyNames() if "wind" in name]
    assert read_wind(mesh) is None
    assert read_wind(Usd.Prim()) is None
