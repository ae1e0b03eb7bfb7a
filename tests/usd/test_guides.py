"""Guides on the written stage: curves and capsules that say what the skeleton says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Gf, Usd, UsdGeom, UsdPhysics

from forestgen.tree.capsules import MOST, collision_capsules
from forestgen.tree.limb_tree import limb_tree
from forestgen.tree.model import TreeModel
from forestgen.usd.extras import Extras
from forestgen.usd.guides import LAYER, from_up, guides_layer
from forestgen.usd.layers import open_stage, save
from forestgen.usd.tree_asset import write_tree_asset
from forestgen.usd.validate import validate
from tests.tree.skeletons import random_tree
from tests.tree.test_wind import leaves_at, model_of


@pytest.fixture(scope="module")
def model() -> TreeModel:
    skeleton = random_tree(300, rng=np.random.default_rng(5))
    return model_of(skeleton, leaves_at(skeleton.position[30:]))


@pytest.fixture(scope="module")
def written(model: TreeModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tree with its guides."""
    folder = tmp_path_factory.mktemp("guides") / "oak"
    return write_tree_asset(model, folder, Extras(guides=True))


def test_validators_find_nothing(written: Path) -> None:
    assert validate(written) == []
    nvidia = pytest.importorskip("usd_validation_nvidia")
    assert list(nvidia.ValidationEngine().validate(str(written)).issues()) == []


def test_each_limb_is_a_curve_as_wide_as_it_is_thick(written: Path, model: TreeModel) -> None:
    stage = open_stage(written)
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/oak/guides/skeleton"))
    tree = limb_tree(model.skeleton)
    count = np.array(curves.GetCurveVertexCountsAttr().Get())
    points, widths = np.array(curves.GetPointsAttr().Get()), np.array(curves.GetWidthsAttr().Get())
    assert curves.GetTypeAttr().Get() == UsdGeom.Tokens.linear
    assert curves.GetWidthsInterpolation() == UsdGeom.Tokens.vertex
    assert_array_equal(count, np.diff(tree.limbs.first))
    assert count.sum() == len(points) == len(widths)
    assert_allclose(points, tree.skeleton.position[tree.limbs.node], atol=1e-6)
    own = np.ones(len(points), bool)
    own[tree.limbs.first[1:-1]] = False
    assert_allclose(widths[own], 2 * tree.skeleton.radius[tree.limbs.node[own]], rtol=1e-6)
    assert np.all(widths[~own] <= 2 * tree.skeleton.radius[tree.limbs.node[~own]] * (1 + 1e-6))
    level = UsdGeom.PrimvarsAPI(curves).GetPrimvar("level")
    assert level.GetInterpolation() == UsdGeom.Tokens.uniform
    assert len(level.Get()) == len(count)


def test_capsules_stand_where_the_wood_is(written: Path, model: TreeModel) -> None:
    stage = open_stage(written)
    known = collision_capsules(limb_tree(model.skeleton))
    prims = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Capsule)]
    assert len(prims) == len(known) <= MOST
    for prim, start, end, radius in zip(prims, known.start, known.end, known.radius, strict=True):
        capsule = UsdGeom.Capsule(prim)
        assert prim.HasAPI(UsdPhysics.CollisionAPI)
        assert capsule.GetAxisAttr().Get() == "Y"
        assert_allclose(capsule.GetRadiusAttr().Get(), radius)
        half = capsule.GetHeightAttr().Get() / 2
        world = capsule.ComputeLocalToWorldTransform(Usd.TimeCode.Default())
        assert_allclose(world.Transform(Gf.Vec3d(0, -half, 0)), start, atol=1e-6)
        assert_allclose(world.Transform(Gf.Vec3d(0, half, 0)), end, atol=1e-6)


def test_extents_are_usds_own_and_nothing_is_drawn(written: Path) -> None:
    stage = open_stage(written)
    guides = [p for p in stage.Traverse() if p.GetPath().HasPrefix("/oak/guides") and p.IsA(UsdGeom.Boundable)]
    assert len(guides) > 2
    for prim in guides:
        boundable = UsdGeom.Boundable(prim)
        wanted = UsdGeom.Boundable.ComputeExtentFromPlugins(boundable, Usd.TimeCode.Default())
        assert_allclose(boundable.GetExtentAttr().Get(), wanted, atol=1e-6)
        assert boundable.ComputePurpose() == UsdGeom.Tokens.guide
    assert not any(Usd.ModelAPI(p).GetKind() for p in stage.Traverse() if p.GetPath().HasPrefix("/oak/guides"))


def test_a_capsule_can_point_straight_down() -> None:
    for direction in ([0, 1, 0], [0, -2, 0], [1, 0, 0], [0.2, -0.9, 0.4]):
        turned = Gf.Rotation(Gf.Quatd(from_up(np.array(direction, float)))).TransformDir(Gf.Vec3d(0, 1, 0))
        assert_allclose(turned, np.array(direction) / np.linalg.norm(direction), atol=1e-6)


def test_same_tree_same_bytes(model: TreeModel, written: Path, tmp_path: Path) -> None:
    again = save(guides_layer("oak", model.skeleton), tmp_path / LAYER)
    assert again.read_bytes() == written.with_name(LAYER).read_bytes()
