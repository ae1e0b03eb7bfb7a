"""The rig on disk: UsdSkel skins it back to the mesh at rest, turns what it should, and sways in a loop."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, Vt

from forestgen.errors import InputError
from forestgen.tree.level import EMPTY_MESH, Level
from forestgen.tree.limb_tree import limb_tree
from forestgen.tree.model import TreeModel
from forestgen.tree.rig import INFLUENCES, joint_turns, rig_of, skin_of_mesh
from forestgen.tree.sway import PERIOD, Gust
from forestgen.usd.flatten import flat_leaves
from forestgen.usd.layers import open_stage, save
from forestgen.usd.rig import FPS, joint_names, write_rig
from forestgen.usd.seams import weld
from forestgen.usd.tree_asset import write_tree_asset
from forestgen.usd.validate import validate
from tests.small_scene import digests
from tests.tree.skeletons import random_tree
from tests.tree.test_rig import skinned
from tests.tree.test_wind import leaves_at, model_of
from tests.usd.models import box_mesh

STRENGTH = 0.4


@pytest.fixture(scope="module")
def model() -> TreeModel:
    skeleton = random_tree(300, rng=np.random.default_rng(5))
    return model_of(skeleton, leaves_at(skeleton.position[30:]))


@pytest.fixture(scope="module")
def folder(model: TreeModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a written tree."""
    return write_tree_asset(model, tmp_path_factory.mktemp("rig") / "oak").parent


@pytest.fixture(scope="module")
def written(model: TreeModel, folder: Path) -> Path:
    """A swaying rig of 40 joints."""
    return write_rig(model, folder, "oak", most_joints=40, strength=STRENGTH)


def wood_of(model: TreeModel) -> NDArray[np.float64]:
    """The points of a tree's wood that are stored: those at the texture's seam once."""
    return np.asarray(model.mesh.points[weld(model.mesh).kept])


def points_of(stage: Usd.Stage, mesh: str, transforms: object = None, time: float = 0.0) -> NDArray[np.float32]:
    """The points of a mesh as UsdSkel skins them, with given joints' transforms or those of a time."""
    cache = UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(stage.GetDefaultPrim()), Usd.TraverseInstanceProxies())
    skeleton = cache.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/oak/skel")))
    if transforms is None:
        transforms = skeleton.ComputeSkinningTransforms(time)
    prim = stage.GetPrimAtPath(f"/oak/geo/{mesh}")
    points = Vt.Vec3fArray(UsdGeom.Mesh(prim).GetPointsAttr().Get())
    assert cache.GetSkinningQuery(prim).ComputeSkinnedPoints(transforms, points, time)
    return np.array(points)


def at_rest(stage: Usd.Stage) -> list[Gf.Matrix4d]:
    """Each joint's transform from where it is bound to where it rests, in the skeleton's space."""
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath("/oak/skel"))
    topology = UsdSkel.Topology(skeleton.GetJointsAttr().Get())
    rest: list[Gf.Matrix4d] = []
    for k, local in enumerate(skeleton.GetRestTransformsAttr().Get()):
        above = topology.GetParent(k)
        rest.append(local * rest[above] if above >= 0 else local)
    return [b.GetInverse() * r for b, r in zip(skeleton.GetBindTransformsAttr().Get(), rest, strict=True)]


def test_validators_find_nothing(written: Path, model: TreeModel, folder: Path, tmp_path: Path) -> None:
    still = write_tree_asset(model, tmp_path / "oak").parent
    for path in (written, write_rig(model, still, "oak")):
        assert [finding for finding in validate(path) if finding.severity != "info"] == []
        nvidia = pytest.importorskip("usd_validation_nvidia")
        assert list(nvidia.ValidationEngine().validate(str(path)).issues()) == []


def test_at_rest_it_is_the_tree(written: Path, model: TreeModel) -> None:
    stage = open_stage(written)
    transforms = Vt.Matrix4dArray(at_rest(stage))
    assert_allclose(points_of(stage, "branches", transforms), wood_of(model), atol=1e-5)
    flat, _ = flat_leaves(model.leaves, model.atlas.prototypes)
    assert_allclose(points_of(stage, "leaves", transforms), flat.points, atol=1e-5)


def test_baked_it_is_the_tree_where_nothing_moves(model: TreeModel, tmp_path: Path) -> None:
    folder = write_tree_asset(model, tmp_path / "oak").parent
    stage = Usd.Stage.Open(str(write_rig(model, folder, "oak")))
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        root = UsdSkel.Root(stage.GetDefaultPrim())
        assert UsdSkel.BakeSkinning(root, Gf.Interval(0, 1))
        points = UsdGeom.Mesh(stage.GetPrimAtPath("/oak/geo/branches")).GetPointsAttr().Get()
        assert_allclose(points, wood_of(model), atol=1e-5)


def test_a_turned_joint_turns_what_hangs_on_it(written: Path, model: TreeModel) -> None:
    stage = open_stage(written)
    rig = rig_of(limb_tree(model.skeleton), 40)
    joint = int(np.flatnonzero((rig.place == 0) & (rig.limb > 0))[2])
    topology = UsdSkel.Topology(UsdSkel.Skeleton(stage.GetPrimAtPath("/oak/skel")).GetJointsAttr().Get())
    quarter = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 1, 0), 90))
    pivot = Gf.Vec3d(*rig.position[joint].tolist())
    turn = Gf.Matrix4d().SetTranslate(-pivot) * quarter * Gf.Matrix4d().SetTranslate(pivot)
    moves = np.zeros(len(rig), bool)
    for k in range(len(rig)):
        moves[k] = k == joint or (topology.GetParent(k) >= 0 and moves[topology.GetParent(k)])
    given = Vt.Matrix4dArray([turn if one else Gf.Matrix4d(1) for one in moves])
    moved = points_of(stage, "branches", given)
    skin = skin_of_mesh(rig, model.mesh)
    share = np.sum(skin.weight * moves[skin.joint], axis=1)[weld(model.mesh).kept]
    still = wood_of(model)
    assert_allclose(moved[share == 0], still[share == 0], atol=1e-5)
    whole = share > 1 - 1e-9
    assert whole.sum() > 10
    wanted = [list(turn.Transform(Gf.Vec3d(*point.tolist()))) for point in still[whole]]
    assert_allclose(moved[whole], wanted, atol=1e-5)


@pytest.mark.parametrize("frame", [0, 50, PERIOD * FPS])
def test_it_sways_as_the_wind_says(written: Path, model: TreeModel, frame: float) -> None:
    stage = open_stage(written)
    rig = rig_of(limb_tree(model.skeleton), 40)
    turn = joint_turns(rig, Gust(frame / FPS, strength=STRENGTH))
    wanted = skinned(rig, skin_of_mesh(rig, model.mesh), model.mesh.points, turn)[weld(model.mesh).kept]
    moved = points_of(stage, "branches", time=frame)
    assert np.linalg.norm(moved - wood_of(model), axis=1).max() > 0.1
    assert_allclose(moved, wanted, atol=1e-4)
    extent = np.array(UsdGeom.Boundable(stage.GetDefaultPrim()).GetExtentAttr().Get(frame))
    assert np.all(extent[0] <= moved.min(axis=0))
    assert np.all(extent[1] >= moved.max(axis=0))


def test_leaves_go_whole_with_the_wood_under_them(written: Path, model: TreeModel) -> None:
    stage = open_stage(written)
    _, leaf = flat_leaves(model.leaves, model.atlas.prototypes)
    prim = stage.GetPrimAtPath("/oak/geo/leaves")
    joints = np.array(UsdSkel.BindingAPI(prim).GetJointIndicesAttr().Get()).reshape(-1, INFLUENCES)
    for k in (0, 17, len(model.leaves) - 1):
        assert len(np.unique(joints[leaf == k], axis=0)) == 1
    assert_array_equal(np.bincount(leaf), [3] * len(model.leaves))


def test_names_and_materials(written: Path, model: TreeModel) -> None:
    stage = open_stage(written)
    names = joint_names(rig_of(limb_tree(model.skeleton), 40))
    assert list(UsdSkel.Skeleton(stage.GetPrimAtPath("/oak/skel")).GetJointsAttr().Get()) == names
    assert names[0] == "trunk_0"
    assert len({name.rsplit("/", 1)[-1] for name in names}) == len(names)
    assert all(Sdf.Path(name).IsPrimPath() for name in names)
    for mesh, material in (("branches", "bark"), ("leaves", "leaf")):
        bound = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(f"/oak/geo/{mesh}")).ComputeBoundMaterial()[0]
        assert bound.GetPath() == f"/oak/mtl/{material}"
    assert Usd.ModelAPI(stage.GetDefaultPrim()).GetKind() == "component"


def test_a_bare_tree_has_no_leaves(model: TreeModel, tmp_path: Path) -> None:
    bare = model_of(model.skeleton, leaves_at(np.zeros((0, 3))))
    folder = write_tree_asset(bare, tmp_path / "bare").parent
    stage = open_stage(write_rig(bare, folder, "bare"))
    assert not stage.GetPrimAtPath("/bare/geo/leaves")
    assert not stage.GetPrimAtPath("/bare/skel/sway")
    assert not stage.HasAuthoredTimeCodeRange()


def test_a_coarser_level_is_rigged_alike(model: TreeModel, tmp_path: Path) -> None:
    folder = write_tree_asset(model, tmp_path / "oak").parent
    level = Level(EMPTY_MESH, model.leaves, model.atlas.prototypes, box_mesh(1.0, 2.0), 100.0)
    stage = open_stage(write_rig(model, folder, "oak", level=level, most_joints=10))
    assert not stage.GetPrimAtPath("/oak/geo/branches")
    assert stage.GetPrimAtPath("/oak/geo/leaves")
    cards = UsdSkel.BindingAPI(stage.GetPrimAtPath("/oak/geo/leaf_cards"))
    assert_array_equal(cards.GetJointIndicesAttr().Get(), np.zeros(8 * INFLUENCES))
    assert_array_equal(np.array(cards.GetJointWeightsAttr().Get()).reshape(-1, INFLUENCES)[:, 0], 1)


def test_same_tree_same_bytes(model: TreeModel, written: Path, tmp_path: Path) -> None:
    folder = write_tree_asset(model, tmp_path / "oak").parent
    again = write_rig(model, folder, "oak", most_joints=40, strength=STRENGTH)
    for suffix in (".usda", ".usdc"):
        assert again.with_suffix(suffix).read_bytes() == written.with_suffix(suffix).read_bytes()


def test_a_folder_without_a_tree_is_refused(model: TreeModel, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"holds no materials\.usdc"):
        write_rig(model, tmp_path, "oak")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match="no prim name"):
        write_rig(model, tmp_path, "7 oaks")


def test_a_failure_midway_leaves_the_earlier_rig(
    model: TreeModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_tree_asset(model, tmp_path / "oak").parent
    write_rig(model, folder, "oak", most_joints=10)
    before = digests(folder)

    def full_disk(layer: Sdf.Layer, path: Path) -> Path:
        if path.suffix == ".usda":
            raise OSError(f"{path} could not be written: disk full")
        return save(layer, path)

    monkeypatch.setattr("forestgen.usd.rig.save", full_disk)
    with pytest.raises(OSError, match="disk full"):
        write_rig(model, folder, "oak", most_joints=40)
    assert digests(folder) == before
