"""An optional rig: a tree as a skinned UsdSkel asset in files of its own, beside the still one.

    <name>_rig.usda   /<name> SkelRoot, kind component; sublayers the next and the tree's materials.usdc
    <name>_rig.usdc   /<name>/skel Skeleton, /<name>/skel/sway SkelAnimation (where a gust is asked for)
                      /<name>/geo/branches, /<name>/geo/leaves Meshes with joint indices and weights

Leaves are one flat mesh here: UsdSkel binds no point instancers (OpenUSD issue 2903).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from forestgen.errors import InputError
from forestgen.staging import install, staging
from forestgen.tree.foliage_poses import quaternions
from forestgen.tree.level import Level, full_level
from forestgen.tree.limb_tree import limb_tree
from forestgen.tree.model import Mesh, TreeModel
from forestgen.tree.rig import INFLUENCES, MOST_JOINTS, Rig, Skin, joint_turns, rig_of, skin_of_leaves, skin_of_mesh
from forestgen.tree.sway import PERIOD, Gust
from forestgen.usd.flatten import flat_leaves
from forestgen.usd.geometry import define_mesh, vec3f
from forestgen.usd.layers import new_stage, require_prim_name, save
from forestgen.usd.seams import weld

FPS = 24
SAMPLE_EVERY = 2  # frames; readers interpolate

Matrices = NDArray[np.float64]  # (J, 4, 4) for column vectors


def write_rig(
    model: TreeModel,
    folder: Path,
    name: str,
    *,
    level: Level | None = None,
    most_joints: int = MOST_JOINTS,
    strength: float | None = None,
) -> Path:
    """Write the rig of a tree, or of a coarser level of it, into the folder of its asset; give the file to open.

    Cards of a level go with the trunk's foot. With a `strength` of the wind (radians, as `Gust`'s) the tree
    sways, in a loop of PERIOD seconds.

    Raises:
        InputError: the folder holds no materials.usdc.
        ValueError: the name is no prim name, or the model cannot be drawn; nothing is written.
        OSError: a file could not be written; an earlier rig is as it was.
    """
    require_prim_name(name)
    if not (folder / "materials.usdc").is_file():
        raise InputError(f"{folder}: holds no materials.usdc; expected the folder of a built tree, OUT/trees/NAME")
    rig = rig_of(limb_tree(model.skeleton), most_joints)
    stage = new_stage(name)
    root = UsdSkel.Root.Define(stage, f"/{name}")
    skeleton = _define_skeleton(stage, root.GetPath().AppendChild("skel"), rig)
    if strength is not None:
        _define_sway(stage, skeleton, rig, strength)
    geo = UsdGeom.Scope.Define(stage, root.GetPath().AppendChild("geo")).GetPath()
    mtl = root.GetPath().AppendChild("mtl")
    drawn = full_level(model) if level is None else level
    if len(drawn.mesh.faces):
        define_mesh(stage, geo.AppendChild("branches"), drawn.mesh, mtl.AppendChild("bark"))
        _bind(stage, geo.AppendChild("branches"), skeleton, drawn.mesh, skin_of_mesh(rig, drawn.mesh))
    if len(drawn.leaves):
        mesh, leaf = flat_leaves(drawn.leaves, drawn.prototypes)
        define_mesh(stage, geo.AppendChild("leaves"), mesh, mtl.AppendChild("leaf"))
        foot = skin_of_leaves(rig, drawn.leaves)
        _bind(stage, geo.AppendChild("leaves"), skeleton, mesh, Skin(foot.joint[leaf], foot.weight[leaf]))
    if len(drawn.cards.faces):
        define_mesh(stage, geo.AppendChild("leaf_cards"), drawn.cards, mtl.AppendChild("leaf_cards"))
        _bind(stage, geo.AppendChild("leaf_cards"), skeleton, drawn.cards, _on_root(len(drawn.cards.points)))
    _author_extent(root, animated=strength is not None)
    layers = {
        f"{name}_rig.usdc": stage.GetRootLayer(),
        f"{name}_rig.usda": _opened_first(name, animated=strength is not None),
    }
    with staging(folder) as work:
        for file, layer in layers.items():
            save(layer, work / file)
        install(work, folder, list(layers))
    return folder / f"{name}_rig.usda"


def _opened_first(name: str, *, animated: bool) -> Sdf.Layer:
    """The layer that brings skeleton, meshes and materials together."""
    stage = new_stage(name)
    _set_times(stage, animated=animated)
    layer = stage.GetRootLayer()
    del stage  # its sublayers are not there yet
    prim = Sdf.CreatePrimInLayer(layer, f"/{name}")
    prim.specifier, prim.typeName, prim.kind = Sdf.SpecifierDef, "SkelRoot", "component"
    layer.subLayerPaths = [f"./{name}_rig.usdc", "./materials.usdc"]
    return layer


def _set_times(stage: Usd.Stage, *, animated: bool) -> None:
    if animated:
        stage.SetStartTimeCode(0)
        stage.SetEndTimeCode(PERIOD * FPS)
        stage.SetTimeCodesPerSecond(FPS)
        stage.SetFramesPerSecond(FPS)


def joint_names(rig: Rig) -> list[str]:
    """Each joint's path (J,) as UsdSkel wants it: trunk_0/trunk_1/limb_0007_0; the last part is unique."""
    names: list[str] = []
    for limb, place, parent in zip(rig.limb.tolist(), rig.place.tolist(), rig.parent.tolist(), strict=True):
        own = f"limb_{limb:04d}_{place}" if limb else f"trunk_{place}"
        names.append(own if parent < 0 else f"{names[parent]}/{own}")
    return names


def _matrices(rotation: NDArray[np.float64], shift: NDArray[np.float64]) -> Vt.Matrix4dArray:
    """USD's matrices, for row vectors, of rotations (J, 3, 3) for column vectors and shifts (J, 3)."""
    matrix = np.tile(np.eye(4), (len(shift), 1, 1))
    matrix[:, :3, :3] = np.swapaxes(rotation, 1, 2)
    matrix[:, 3, :3] = shift
    return Vt.Matrix4dArray([Gf.Matrix4d(rows) for rows in matrix.tolist()])


def _local(rig: Rig, turn: NDArray[np.float64] | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation (J, 3, 3) and shift (J, 3) of each joint in its parent's frame; turns (J, 3, 3) are the tree's."""
    above = np.where(rig.parent[:, None, None] >= 0, rig.frame[rig.parent], np.eye(3))
    back = np.swapaxes(above, 1, 2)
    origin = np.where(rig.parent[:, None] >= 0, rig.position[rig.parent], 0.0)
    own = rig.frame if turn is None else turn @ rig.frame
    return back @ own, np.einsum("jik,jk->ji", back, rig.position - origin)


def _define_skeleton(stage: Usd.Stage, path: Sdf.Path, rig: Rig) -> UsdSkel.Skeleton:
    skeleton = UsdSkel.Skeleton.Define(stage, path)
    skeleton.CreateJointsAttr(joint_names(rig))
    skeleton.CreateBindTransformsAttr(_matrices(rig.frame, rig.position))
    skeleton.CreateRestTransformsAttr(_matrices(*_local(rig)))
    skeleton.CreatePurposeAttr(UsdGeom.Tokens.guide)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
    return skeleton


def _define_sway(stage: Usd.Stage, skeleton: UsdSkel.Skeleton, rig: Rig, strength: float) -> None:
    """Author one loop of sway in the wind."""
    _set_times(stage, animated=True)
    sway = UsdSkel.Animation.Define(stage, skeleton.GetPath().AppendChild("sway"))
    sway.CreateJointsAttr(joint_names(rig))
    _, shift = _local(rig)
    sway.CreateTranslationsAttr(vec3f(shift))
    sway.CreateScalesAttr(Vt.Vec3hArray.FromNumpy(np.ones((len(rig), 3), np.float16)))
    rotations = sway.CreateRotationsAttr()
    for frame in _frames():
        rotation, _ = _local(rig, joint_turns(rig, Gust(frame / FPS, strength=strength)))
        turn = quaternions(rotation)[:, [1, 2, 3, 0]].astype(np.float32)
        rotations.Set(Vt.QuatfArray.FromNumpy(np.ascontiguousarray(turn)), float(frame))
    UsdSkel.BindingAPI(skeleton).CreateAnimationSourceRel().SetTargets([sway.GetPath()])


def _author_extent(root: UsdSkel.Root, *, animated: bool) -> None:
    """Author the box of all that is skinned, as UsdSkel reckons it from the joints, at rest and in every sample."""
    extent = root.CreateExtentAttr()
    for time in (Usd.TimeCode.Default(), *(_frames() if animated else ())):
        extent.Set(UsdGeom.Boundable.ComputeExtentFromPlugins(root, time), time)


def _frames() -> range:
    return range(0, round(PERIOD * FPS) + 1, SAMPLE_EVERY)


def _on_root(n_points: int) -> Skin:
    """All points (P,) on joint 0."""
    weight = np.zeros((n_points, INFLUENCES))
    weight[:, 0] = 1
    return Skin(np.zeros((n_points, INFLUENCES), np.int64), weight)


def _bind(stage: Usd.Stage, path: Sdf.Path, skeleton: UsdSkel.Skeleton, mesh: Mesh, skin: Skin) -> None:
    """Bind what is written of a mesh with P points to the skeleton."""
    kept = weld(mesh).kept
    binding = UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath(path))
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    joints = np.ascontiguousarray(skin.joint[kept].ravel(), np.int32)
    weights = np.ascontiguousarray(skin.weight[kept].ravel(), np.float32)
    binding.CreateJointIndicesPrimvar(False, INFLUENCES).Set(Vt.IntArray.FromNumpy(joints))
    binding.CreateJointWeightsPrimvar(False, INFLUENCES).Set(Vt.FloatArray.FromNumpy(weights))
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1))
