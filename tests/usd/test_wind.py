"""The wind primvars on the written stage: shaped as USD wants, small, and enough to bend the tree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from forestgen.tree.leaf_sort import sorted_leaves
from forestgen.tree.level import EMPTY_MESH, NO_LEAVES, Level, full_level
from forestgen.tree.limb_tree import limb_tree
from forestgen.tree.model import Leaves, TreeModel
from forestgen.tree.sway import GUST, HZ_PER_LEVEL, LEAN, SIDE, SIDE_HZ, TRUNK_HZ, Gust, sway
from forestgen.tree.wind import wind_of
from forestgen.usd.extras import Extras
from forestgen.usd.layers import open_stage, save
from forestgen.usd.seams import weld
from forestgen.usd.tree_asset import write_tree_asset
from forestgen.usd.validate import validate
from forestgen.usd.wind import LAYER, wind_layer
from tests.tree.skeletons import random_tree
from tests.tree.test_wind import leaves_at, model_of
from tests.usd.models import box_mesh, leaf_prototype

NAMES = ("pivot", "axis", "level", "phase", "stiffness")


@pytest.fixture(scope="module")
def model() -> TreeModel:
    skeleton = random_tree(300, rng=np.random.default_rng(5))
    return model_of(skeleton, leaves_at(skeleton.position[30:]))


@pytest.fixture(scope="module")
def written(model: TreeModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tree with its wind."""
    folder = tmp_path_factory.mktemp("wind") / "oak"
    return write_tree_asset(model, folder, Extras(wind=True))


def shader(prim: Usd.Prim, points: NDArray[np.float32], gust: Gust) -> NDArray[np.float64]:
    """The plain shader of docs/wind.md, fed with nothing but what is authored."""
    api = UsdGeom.PrimvarsAPI(prim)
    limb = np.array(api.GetPrimvar("wind:limb").ComputeFlattened())
    above = np.array(api.FindPrimvarWithInheritance("wind:limbs:parent").Get())
    tables = [np.array(api.FindPrimvarWithInheritance(f"wind:limbs:{name}").Get(), float) for name in NAMES]
    pivot, axis, level, phase, stiffness = tables
    along = np.array([np.cos(gust.direction), 0, -np.sin(gust.direction)])
    across = np.array([np.sin(gust.direction), 0, np.cos(gust.direction)])

    def share(point: NDArray[np.float64], k: int) -> float:
        t = np.clip((point - pivot[k]) @ axis[k] / (axis[k] @ axis[k]), 0, 1)
        return float(t * (6 - 4 * t + t * t) / 3)

    def turned(point: NDArray[np.float64], k: int, part: float) -> NDArray[np.float64]:
        cycle = (TRUNK_HZ + HZ_PER_LEVEL * level[k]) * gust.time + phase[k]
        blow = (LEAN + GUST * np.sin(2 * np.pi * cycle)) * along
        blow = blow + SIDE * np.sin(2 * np.pi * (SIDE_HZ * cycle + phase[k])) * across
        turn = part * gust.strength * (1 - stiffness[k]) * np.cross(axis[k] / np.linalg.norm(axis[k]), blow)
        angle = np.linalg.norm(turn)
        if angle == 0:
            return point
        n, v = turn / angle, point - pivot[k]
        turned = v * np.cos(angle) + np.cross(n, v) * np.sin(angle) + n * (n @ v) * (1 - np.cos(angle))
        return np.asarray(pivot[k] + turned)

    out = np.array(points, float)
    for i, k in enumerate(limb.tolist()):
        part = share(out[i], k)
        while k >= 0:
            out[i] = turned(out[i], k, part)
            part, k = (share(pivot[k], above[k]), above[k]) if above[k] >= 0 else (0.0, -1)
    return out


def test_a_shader_bends_the_tree_by_what_is_authored(written: Path, model: TreeModel) -> None:
    stage = open_stage(written)
    gust = Gust(time=2.3, direction=1.1, strength=0.3)
    kept = weld(model.mesh).kept  # points at the texture's seam are stored once
    still = model.mesh.points[kept].astype(np.float32)
    blown = sway(model, wind_of(limb_tree(model.skeleton)), gust)
    wood = shader(stage.GetPrimAtPath("/oak/geo/LOD0/branches"), still, gust)
    assert np.linalg.norm(wood - still, axis=1).max() > 0.3  # it does move
    assert_allclose(wood, blown.mesh.points[kept], atol=2e-5)  # stored as float32
    leaves = shader(stage.GetPrimAtPath("/oak/geo/LOD0/leaves"), model.leaves.position.astype(np.float32), gust)
    assert_allclose(leaves, blown.leaves.position, atol=2e-5)


def test_primvars_are_shaped_as_usd_wants(written: Path, model: TreeModel) -> None:
    stage = open_stage(written)
    wind = wind_of(limb_tree(model.skeleton))
    tables = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/oak/geo"))
    assert tables.GetPrimvar("wind:limbs:parent").GetElementSize() == len(wind)
    for name, count in (("branches", len(weld(model.mesh).kept)), ("leaves", len(model.leaves))):
        api = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(f"/oak/geo/LOD0/{name}"))
        limb = np.array(api.GetPrimvar("wind:limb").ComputeFlattened())
        for key in NAMES:
            assert api.GetPrimvar(f"wind:{key}").GetInterpolation() == UsdGeom.Tokens.vertex
            own = np.array(api.GetPrimvar(f"wind:{key}").ComputeFlattened())
            assert len(own) == count
            table = np.array(tables.GetPrimvar(f"wind:limbs:{key}").Get())
            assert_array_equal(own, table[limb])
            assert_allclose(table, getattr(wind, key), atol=1e-6)


def test_validators_find_nothing(written: Path) -> None:
    assert validate(written) == []
    nvidia = pytest.importorskip("usd_validation_nvidia")
    assert list(nvidia.ValidationEngine().validate(str(written)).issues()) == []


def test_the_layer_holds_overs_only_and_few_bytes(written: Path, model: TreeModel) -> None:
    layer = Sdf.Layer.FindOrOpen(str(written.with_name(LAYER)))
    specs: list[Sdf.PrimSpec] = []
    layer.Traverse("/", lambda path: specs.append(layer.GetPrimAtPath(path)) if path.IsPrimPath() else None)
    assert len(specs) == 5
    assert all(spec.specifier == Sdf.SpecifierOver for spec in specs)
    n_limbs = len(limb_tree(model.skeleton).limbs)
    # at most 8 bytes a point or leaf (three indices); 40 bytes a limb in the tables and for branches and leaves each
    n = len(model.mesh.points) + len(model.leaves)
    assert written.with_name(LAYER).stat().st_size < 8 * n + 120 * n_limbs + 6000


def test_same_tree_same_bytes(model: TreeModel, written: Path, tmp_path: Path) -> None:
    again = save(wind_layer("oak", model.skeleton, [full_level(model)]), tmp_path / LAYER)
    assert again.read_bytes() == written.with_name(LAYER).read_bytes()


def test_cards_swing_with_the_trunk_and_what_is_not_there_gets_nothing(model: TreeModel) -> None:
    full = full_level(model)
    cards = Level(EMPTY_MESH, NO_LEAVES, (), box_mesh(1.0, 2.0), 100.0)
    layer = wind_layer("oak", model.skeleton, [full, cards])
    assert not layer.GetPrimAtPath("/oak/geo/LOD1/branches")
    assert not layer.GetPrimAtPath("/oak/geo/LOD1/leaves")
    stage = Usd.Stage.Open(layer)
    limb = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/oak/geo/LOD1/leaf_cards")).GetPrimvar("wind:limb")
    assert list(limb.ComputeFlattened()) == [0] * 8


def test_two_hundred_thousand_leaves_cost_little(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    skeleton = random_tree(20_000, rng=rng)
    assert len(limb_tree(skeleton).limbs) > 4000
    anyhow = leaves_at(skeleton.position[rng.integers(20, 20_000, 200_000)])

    def n_bytes(leaves: Leaves) -> int:
        level = Level(EMPTY_MESH, leaves, (leaf_prototype(0, 1),), EMPTY_MESH, 1000.0)
        return save(wind_layer("oak", skeleton, [level]), tmp_path / LAYER).stat().st_size

    assert n_bytes(anyhow) < 1.5e6
    assert n_bytes(sorted_leaves(anyhow, skeleton)) < 0.2 * n_bytes(anyhow)
