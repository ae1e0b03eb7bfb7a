"""An animated tree asset: a layer of time samples, brought in by a variant of the tree's root prim.

<name>.usda    variant set `growth`: static (selected), animated (payload growth.usdc); time codes
growth.usdc    over /<name>/geo/LOD0: samples of points, normals, positions, scales, orientations, extents
growing.usda   the same tree with `animated` selected: for readers that cannot choose a variant
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, Vt

from forestgen.errors import InputError
from forestgen.usd.geometry import Box, box_of, instances_box, union, vec3f
from forestgen.usd.layers import new_stage, open_stage, save
from forestgen.usd.polygons import read_triangles

SET, STILL, MOVING = "growth", "static", "animated"
FULL = "geo/LOD0"  # the level of detail that grows; the others show the finished tree
LAYER, FILM = "growth.usdc", "growing.usda"


@dataclass(frozen=True, eq=False)
class StillTree:
    """The geometry of a written tree. P vertices, twice where the texture has a seam; F faces, L leaves."""

    name: str
    points: NDArray[np.float32]  # (P, 3) m
    kept: NDArray[np.int64]  # (K,) the vertex that each stored point is
    normals: NDArray[np.float32]  # (P, 3), or (0, 3) where they are not one a vertex
    faces: NDArray[np.int64]  # (F, 3)
    leaf_position: NDArray[np.float32]  # (L, 3) m
    leaf_turn: NDArray[np.float16]  # (L, 4) i j k real
    leaf_scale: NDArray[np.float32]  # (L, 3)
    leaf_box: NDArray[np.float32]  # (L, 2, 3) of each leaf's prototype


def read_still(path: Path) -> StillTree:
    """Read the static geometry of a tree asset.

    Raises:
        InputError: it is no tree of this program.
    """
    stage = open_stage(path)
    root = stage.GetDefaultPrim()
    if not root:
        raise InputError(f"{path}: has no default prim; expected the root layer of a tree: build the tree again")
    if SET in root.GetVariantSets().GetNames():
        with Usd.EditContext(stage, stage.GetSessionLayer()):
            root.GetVariantSet(SET).SetVariantSelection(STILL)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(root.GetPath().AppendPath(f"{FULL}/branches")))
    wood = read_triangles(mesh.GetPrim(), Usd.TimeCode.Default()) if mesh else None
    if wood is None or not np.all(np.array(mesh.GetFaceVertexCountsAttr().Get()) == 3):
        raise InputError(f"{path}: has no triangles at {FULL}/branches; expected a tree that was built: build it again")
    points = _rows(mesh.GetPointsAttr().Get(), np.float32, 3)
    normals = _rows(mesh.GetNormalsAttr().Get(), np.float32, 3)
    leaves = UsdGeom.PointInstancer(stage.GetPrimAtPath(root.GetPath().AppendPath(f"{FULL}/leaves")))
    box, which = np.zeros((1, 2, 3), np.float32), np.zeros(0, np.int64)
    if leaves:
        which = np.array(leaves.GetProtoIndicesAttr().Get(), np.int64)
        targets = [UsdGeom.Mesh(stage.GetPrimAtPath(path)) for path in leaves.GetPrototypesRel().GetForwardedTargets()]
        box = np.array([target.GetExtentAttr().Get() for target in targets], np.float32)
    return StillTree(
        name=root.GetName(),
        points=points[wood.stored],
        kept=np.unique(wood.stored, return_index=True)[1],
        normals=normals[wood.stored] if len(normals) == len(points) else normals[:0],
        faces=wood.faces,
        leaf_position=_rows(leaves.GetPositionsAttr().Get() if leaves else None, np.float32, 3),
        leaf_turn=_rows(leaves.GetOrientationsAttr().Get() if leaves else None, np.float16, 4),
        leaf_scale=_rows(leaves.GetScalesAttr().Get() if leaves else None, np.float32, 3),
        leaf_box=box[which],
    )


def _rows(value: object, dtype: type, width: int) -> NDArray:  # type: ignore[type-arg]
    return np.array([] if value is None else value, dtype).reshape(-1, width)


class GrowthLayer:
    """Time samples of one tree, frame by frame; attributes keep their still values at no time."""

    def __init__(self, still: StillTree, fps: float, frames: int) -> None:
        self.still = still
        self.stage = new_stage(still.name)
        self.layer = self.stage.GetRootLayer()
        set_times(self.stage, fps, frames)
        self.geo = Sdf.Path(f"/{still.name}/{FULL}")
        self.boxes: dict[int, list[Box]] = {}
        names = {"branches": ("points", "normals"), "leaves": ("positions", "scales", "orientations")}
        types = {"orientations": "quath[]", "points": "point3f[]", "positions": "point3f[]", "normals": "normal3f[]"}
        for prim in ("branches", "leaves")[: 2 if len(still.leaf_position) else 1]:
            for name in (*names[prim], "extent"):
                _attribute(self.layer, self.geo.AppendPath(f"{prim}.{name}"), types.get(name, "float3[]"))

    def add_branches(self, frame: int, points: NDArray[np.float32], normals: NDArray[np.float32] | None) -> None:
        """The wood in a frame: places (P, 3) and, in some frames, normals (P, 3)."""
        box, kept = box_of(points), self.still.kept
        self._sample("branches.points", frame, vec3f(points[kept]))
        self._sample("branches.extent", frame, vec3f(box))
        if normals is not None and len(normals):
            self._sample("branches.normals", frame, vec3f(normals[kept]))
        self.boxes.setdefault(frame, []).append(box)

    def add_leaves(
        self,
        frame: int,
        position: NDArray[np.float32],
        scale: NDArray[np.float32],
        turn: NDArray[np.float16],
        is_turned: bool,
    ) -> None:
        """The leaves in a frame: places and scales (L, 3), and turns (L, 4) i j k real, written where `is_turned`."""
        box = instances_box(position, turn, np.ones(len(scale)), self.still.leaf_box * scale[:, None, :])
        self._sample("leaves.positions", frame, vec3f(position))
        self._sample("leaves.scales", frame, vec3f(scale))
        self._sample("leaves.extent", frame, vec3f(box))
        if is_turned:
            self._sample("leaves.orientations", frame, Vt.QuathArray.FromNumpy(np.ascontiguousarray(turn)))
        self.boxes.setdefault(frame, []).append(box)

    def save(self, folder: Path) -> Path:
        """Write the layer.

        Raises:
            OSError: it could not be written.
        """
        return save(self.layer, folder / LAYER)

    def _sample(self, where: str, frame: int, value: object) -> None:
        self.layer.SetTimeSample(self.geo.AppendPath(where), float(frame), value)


def _attribute(layer: Sdf.Layer, path: Sdf.Path, kind: str) -> None:
    prim = Sdf.CreatePrimInLayer(layer, path.GetPrimPath())
    Sdf.AttributeSpec(prim, path.name, Sdf.ValueTypeNames.Find(kind))


def set_times(stage: Usd.Stage, fps: float, frames: int) -> None:
    """Frames 1 .. `frames` as time codes of a stage."""
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(frames)
    stage.SetTimeCodesPerSecond(fps)
    stage.SetFramesPerSecond(fps)


def write_variants(
    path: Path, folder: Path, boxes: dict[int, list[Box]], fps: float, frames: int, notes: dict[str, object]
) -> Path:
    """Write into `folder` the root layer at `path` with its variant set and the layer that selects `animated`.

    An earlier variant set of the same name is replaced; all else in the root layer stays. The extents
    hint goes into both variants, animated in one; `notes` become custom data of the animated one.

    Raises:
        OSError: one could not be written.
    """
    stage = Usd.Stage.Open(Sdf.Layer.OpenAsAnonymous(os.fspath(path)), Usd.Stage.LoadNone)
    root = stage.GetDefaultPrim()
    name = root.GetName()
    hint = UsdGeom.ModelAPI(root).GetExtentsHint()
    spec = stage.GetRootLayer().GetPrimAtPath(root.GetPath())
    if SET in spec.variantSets:
        del spec.variantSets[SET]
    if "extentsHint" in spec.properties:
        spec.RemoveProperty(spec.properties["extentsHint"])
    choice = root.GetVariantSets().AddVariantSet(SET)
    for variant in (MOVING, STILL):
        choice.AddVariant(variant)
        choice.SetVariantSelection(variant)
        with choice.GetVariantEditContext():
            attribute = root.CreateAttribute("extentsHint", Sdf.ValueTypeNames.Float3Array, False)
            attribute.Set(hint)
            if variant == MOVING:
                root.GetPayloads().AddPayload(f"./{LAYER}")
                for frame, parts in sorted(boxes.items()):
                    attribute.Set(vec3f(union(parts)), float(frame))
                root.SetCustomDataByKey("forestgen:growth", notes)
    set_times(stage, fps, frames)
    save(stage.GetRootLayer(), folder / path.name)
    return save(_film_layer(name, path.name, fps, frames), folder / FILM)


def _film_layer(name: str, asset: str, fps: float, frames: int) -> Sdf.Layer:
    """The layer that references the asset with `animated` selected; no stage sees it: the asset is not there yet."""
    stage = new_stage(name)
    set_times(stage, fps, frames)
    layer = stage.GetRootLayer()
    del stage
    prim = Sdf.CreatePrimInLayer(layer, f"/{name}")
    prim.specifier = Sdf.SpecifierDef
    prim.referenceList.Prepend(Sdf.Reference(f"./{asset}"))
    prim.variantSelections[SET] = MOVING
    return layer
