"""A written tree, read back as a model and its levels of detail: what exports start from.

Only what this program wrote is read: the numbers are those stored, as float64. Views are not read. A tree has a
season: `photo` unless another is asked for; leaves that have fallen by then are not read either.
"""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdShade

from forestgen.errors import InputError
from forestgen.reference import read_provenance
from forestgen.tree.level import EMPTY_MESH, NO_LEAVES, SCREEN_PX, Level
from forestgen.tree.model import Atlas, Bark, LeafPrototype, Leaves, Mesh, TreeModel
from forestgen.usd.layers import open_stage
from forestgen.usd.lights import TEXTURE
from forestgen.usd.polygons import read_triangles
from forestgen.usd.seasons import SEASON_SET
from forestgen.usd.surface import Surface, surface_of
from forestgen.usd.variants import ALL, LOD_SET, SIZES, level_name

CARDS = "leaf_cards"


def read_model(folder: Path, season: str | None = None) -> TreeModel:
    """The tree in a folder OUT/trees/NAME as written, without its views.

    Raises:
        InputError: the folder is no tree that a build wrote, a file of it is missing or broken, or it has no
            such season.
    """
    folder = Path(folder)
    stage, root = _open_tree(folder, season)
    kept = read_provenance(folder / "reference")
    level = _level(stage, root, 0, math.inf)
    bark = surface_of(_at(stage, root, "geo/LOD0/branches"), {})
    leaf = _leaf_surface(stage, root)
    rgba = np.zeros((1, 1, 4), np.uint8) if leaf is None or leaf.texture is None else leaf.texture
    return TreeModel(
        name=kept.name,
        method=kept.method,
        seed=kept.seed,
        height=kept.height,
        views=(),
        skeleton=kept.skeleton,
        mesh=level.mesh,
        bark=Bark(_bark_texels(bark), *kept.bark_size),
        atlas=Atlas(rgba, tuple(_with_colour(prototype, rgba) for prototype in level.prototypes)),
        leaves=level.leaves,
        evergreen=kept.evergreen,
        costs=kept.costs,
        notes=kept.notes,
    )


def read_seasons(folder: Path) -> tuple[str, ...]:
    """The seasons of the tree in a folder OUT/trees/NAME; none where it was built without.

    Raises:
        InputError: as `read_model`.
    """
    _, root = _open_tree(Path(folder), None)
    return tuple(root.GetVariantSet(SEASON_SET).GetVariantNames())


def read_levels(folder: Path, season: str | None = None) -> tuple[Level, ...]:
    """All levels of detail of the tree in a folder OUT/trees/NAME, the full one first.

    Raises:
        InputError: as `read_model`.
    """
    stage, root = _open_tree(Path(folder), season)
    if ALL in root.GetVariantSet(LOD_SET).GetVariantNames():
        _select(stage, root, LOD_SET, ALL)
    heuristic = stage.GetPrimAtPath(root.GetPath().AppendChild(SIZES))
    shares = list(heuristic.GetAttribute("thresholds").Get()) if heuristic else []
    sizes = [math.inf, *(SCREEN_PX * float(share) for share in shares)]
    return tuple(_level(stage, root, k, size) for k, size in enumerate(sizes))


def read_card_atlas(folder: Path, season: str | None = None) -> NDArray[np.uint8] | None:
    """The card atlas (H, W, 4) of the tree in a folder OUT/trees/NAME; None where it has no cards.

    Raises:
        InputError: as `read_model`.
    """
    stage, root = _open_tree(Path(folder), season)
    texture = UsdShade.Shader(_at(stage, root, f"mtl/{CARDS}/{TEXTURE}"))
    if not texture:
        return None
    path = Path(folder) / texture.GetInput("file").Get().path
    image = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED) if path.is_file() else None
    if image is None or image.ndim != 3 or image.shape[2] != 4:
        raise InputError(f"{path}: expected the cards' picture, a PNG with alpha: build the tree again")
    return np.asarray(image[..., [2, 1, 0, 3]], np.uint8)


def _open_tree(folder: Path, season: str | None) -> tuple[Usd.Stage, Usd.Prim]:
    name = folder.resolve().name
    path = folder / f"{name}.usda"
    if not path.is_file():
        raise InputError(f"{folder}: holds no {name}.usda; expected the folder of a built tree, OUT/trees/NAME")
    stage = open_stage(path)
    root = stage.GetDefaultPrim()
    if not root or not _at(stage, root, "geo/LOD0/branches"):
        raise InputError(f"{path}: has no geo/LOD0/branches; expected a tree that was built: build it again")
    if season is not None:
        known = root.GetVariantSet(SEASON_SET).GetVariantNames()
        if season not in known:
            raise InputError(f"--season: {folder} has no {season!r}; it has {', '.join(known) or 'none'}")
        _select(stage, root, SEASON_SET, season)
    return stage, root


def _select(stage: Usd.Stage, root: Usd.Prim, name: str, variant: str) -> None:
    """Select a variant for as long as the stage is open."""
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        root.GetVariantSet(name).SetVariantSelection(variant)


def _at(stage: Usd.Stage, root: Usd.Prim, where: str) -> Usd.Prim:
    return stage.GetPrimAtPath(root.GetPath().AppendPath(where))


def _level(stage: Usd.Stage, root: Usd.Prim, k: int, switch_px: float) -> Level:
    home = f"geo/{level_name(k)}"
    leaves, prototypes = _leaves(_at(stage, root, f"{home}/leaves"))
    mesh, cards = (_mesh(_at(stage, root, f"{home}/{name}")) for name in ("branches", CARDS))
    return Level(mesh, leaves, prototypes, cards, switch_px)


def _mesh(prim: Usd.Prim) -> Mesh:
    triangles = read_triangles(prim, Usd.TimeCode.Default()) if prim else None
    if triangles is None:
        return EMPTY_MESH
    uv = triangles.uv("st")
    if uv is None or triangles.normals is None:
        raise InputError(f"{prim.GetPath()}: has no primvars:st or no normals: build the tree again")
    return Mesh(triangles.points, triangles.normals, uv, triangles.faces)


def _leaves(prim: Usd.Prim) -> tuple[Leaves, tuple[LeafPrototype, ...]]:
    if not (prim and prim.IsActive()):
        return NO_LEAVES, ()
    instancer = UsdGeom.PointInstancer(prim)
    targets = instancer.GetPrototypesRel().GetForwardedTargets()
    blades = [_mesh(prim.GetStage().GetPrimAtPath(target)) for target in targets]
    prototypes = tuple(
        LeafPrototype(blade.points, blade.normals, blade.uv, blade.faces, np.full(3, 0.5), 1.0) for blade in blades
    )
    turn = np.array(instancer.GetOrientationsAttr().Get(), float)[:, [3, 0, 1, 2]]
    leaves = Leaves(
        position=np.array(instancer.GetPositionsAttr().Get(), float),
        orientation=turn / np.linalg.norm(turn, axis=1, keepdims=True),  # stored as halfs: unit to 1e-3
        size=np.array(instancer.GetScalesAttr().Get(), float)[:, 0],
        prototype=np.array(instancer.GetProtoIndicesAttr().Get(), np.int64),
    )
    fallen = np.array(instancer.GetInvisibleIdsAttr().Get() or [], np.int64)
    return leaves.take(np.setdiff1d(np.arange(len(leaves)), fallen)), prototypes


def _leaf_surface(stage: Usd.Stage, root: Usd.Prim) -> Surface | None:
    prim = _at(stage, root, "geo/LOD0/leaves")
    if not (prim and prim.IsActive()):
        return None
    first = UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets()[0]
    return surface_of(stage.GetPrimAtPath(first), {})


def _bark_texels(surface: Surface) -> NDArray[np.uint8]:
    if surface.texture is not None:
        return np.ascontiguousarray(surface.texture[..., :3])
    return np.round(surface.colour[:3] * 255).astype(np.uint8).reshape(1, 1, 3)


def _with_colour(prototype: LeafPrototype, rgba: NDArray[np.uint8]) -> LeafPrototype:
    """The prototype with its mean colour and its length in the atlas, measured over the box of its uv."""
    height, width = rgba.shape[:2]
    low, high = prototype.uv.min(axis=0), prototype.uv.max(axis=0)
    rows = slice(int((1 - high[1]) * height), max(int(np.ceil((1 - low[1]) * height)), 1))
    columns = slice(int(low[0] * width), max(int(np.ceil(high[0] * width)), 1))
    cell = rgba[rows, columns].reshape(-1, 4).astype(float)
    weight = cell[:, 3] + 1e-9
    colour = (cell[:, :3] * weight[:, None]).sum(axis=0) / weight.sum() / 255
    length = float(np.linalg.norm((high - low) * [width, height]))
    return LeafPrototype(prototype.points, prototype.normals, prototype.uv, prototype.faces, colour, length)
