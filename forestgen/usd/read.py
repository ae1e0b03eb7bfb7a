"""Any USD stage, read from disk, as things to draw: meshes with a surface and every place where they stand."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdShade

from forestgen.errors import InputError
from forestgen.render.drawable import Drawable
from forestgen.usd.layers import open_stage
from forestgen.usd.polygons import Triangles, read_triangles
from forestgen.usd.surface import Surface, surface_of

log = logging.getLogger(__name__)

LEAF_WORDS = ("leaf", "leaves", "foliage", "needle")  # DESIGN section 5: foliage says so in its names
TOO_MANY = 50_000_000  # places in one stage; more would not fit into memory

SEEN = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
BELOW_PROTOTYPE = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)  # class and over too

Placed = list[tuple[Drawable, NDArray[np.float64]]]  # a mesh in its own space, and its places (K, 4, 4)


def read_drawables(path: Path, prim_path: str | None = None) -> list[Drawable]:
    """Open a stage with all payloads and give what it shows, in metres with Y up, in world space.

    Point instancers (nested ones too) and instances become places of one drawable. Invisible
    prims, guides and proxies are left out; with `prim_path`, only what lies below it comes.

    Raises:
        InputError: the stage, a layer, a texture or the prim is missing, or geometry is broken.
    """
    stage = _composed(path)
    root = stage.GetPrimAtPath(prim_path) if prim_path else stage.GetPseudoRoot()
    if not root:
        raise InputError(f"{path}: there is no prim {prim_path}")
    return _drawables(_Reader(stage), root)


def stage_drawables(stage: Usd.Stage, prim_path: Sdf.Path | str) -> list[Drawable]:
    """What `read_drawables` gives, of a stage that is open, with the variants that are selected in it.

    Each is named after the prim that its material is bound to: a mesh, or a subset of its faces.

    Raises:
        InputError: as `read_drawables`.
    """
    return _drawables(_Reader(stage), stage.GetPrimAtPath(prim_path))


def read_film(path: Path, times: Iterable[float]) -> Iterator[list[Drawable]]:
    """Open a stage and give what it shows at one time code after another, as `read_drawables` does.

    Raises:
        InputError: as `read_drawables`.
    """
    stage = _composed(path)
    surfaces: dict[str, Surface] = {}
    for time in times:
        reader = _Reader(stage, Usd.TimeCode(time))
        reader.surfaces = surfaces
        yield _drawables(reader, stage.GetPseudoRoot())


def _composed(path: Path) -> Usd.Stage:
    """An open stage of which every layer was found."""
    stage = open_stage(path)
    errors = stage.GetCompositionErrors()
    if errors:
        raise InputError(f"{path}: {errors[0]}")
    return stage


def _drawables(reader: _Reader, root: Usd.Prim) -> list[Drawable]:
    world = _to_metres_y_up(reader.stage)
    return [_with_places(drawable, world @ places) for drawable, places in _merge(reader.below_world(root))]


def is_foliage(prim: Usd.Prim, material: str) -> bool:
    """Whether a mesh is foliage, by the material's name or a prim's from the mesh up to its component.

    The component's own name does not count: a tree may be called `leafy_oak` and still have wood.
    """
    names = [material]
    while prim and not prim.IsPseudoRoot() and not prim.IsModel():
        names.append(prim.GetName())
        prim = prim.GetParent()
    return any(word in name.lower() for name in names for word in LEAF_WORDS)


class _Reader:
    """One pass over one stage; remembers surfaces and what was found below each instanced prototype."""

    def __init__(self, stage: Usd.Stage, time: Usd.TimeCode | None = None) -> None:
        self.stage = stage
        last = Usd.TimeCode(stage.GetEndTimeCode()) if stage.HasAuthoredTimeCodeRange() else Usd.TimeCode.Default()
        self.time = last if time is None else time
        self.surfaces: dict[str, Surface] = {}
        self.instances: dict[tuple[str, str], Placed] = {}
        self.xforms = UsdGeom.XformCache(self.time)

    def below_world(self, root: Usd.Prim) -> Placed:
        """What is at and below a prim, in the stage's world space."""
        if UsdGeom.Imageable(root) and UsdGeom.Imageable(root).ComputeVisibility(self.time) == UsdGeom.Tokens.invisible:
            return []
        return _moved(self.at(root, SEEN), _matrix(self.xforms.GetParentToWorldTransform(root)))

    def at(self, prim: Usd.Prim, predicate: object) -> Placed:
        """What is at and below a prim, in its parent's space."""
        image = UsdGeom.Imageable(prim)
        if image and image.GetVisibilityAttr().Get(self.time) == UsdGeom.Tokens.invisible:
            return []
        found = self.instance(prim, predicate) if prim.IsInstance() else self.inside(prim, predicate)
        return _moved(found, self.local(prim)) if found else []

    def instance(self, prim: Usd.Prim, predicate: object) -> Placed:
        """What is below an instance: read once for all instances of one prototype under one material."""
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        key = (str(prim.GetPrototype().GetPath()), str(material.GetPath()) if material else "")
        if key not in self.instances:
            self.instances[key] = self.inside(prim, predicate)
        return self.instances[key]

    def inside(self, prim: Usd.Prim, predicate: object) -> Placed:
        """What is at and below a prim, in its own space."""
        if prim.IsA(UsdGeom.PointInstancer):
            return self.instanced(UsdGeom.PointInstancer(prim)) if self.is_drawn(prim) else []
        if prim.IsA(UsdGeom.Mesh):
            return self.mesh(prim) if self.is_drawn(prim) else []
        if prim.IsA(UsdGeom.Gprim) and self.is_drawn(prim):
            log.warning("%s is a %s; only meshes are drawn", prim.GetPath(), prim.GetTypeName())
        return [item for child in prim.GetFilteredChildren(predicate) for item in self.at(child, predicate)]

    def instanced(self, instancer: UsdGeom.PointInstancer) -> Placed:
        """What a point instancer shows, in its own space."""
        path = instancer.GetPath()
        which = np.array(instancer.GetProtoIndicesAttr().Get(self.time) or [], np.int64)
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        if not len(which):
            return []
        if not 0 <= which.min() <= which.max() < len(targets):
            raise InputError(f"{path}: protoIndices run to {which.max()}, but there are {len(targets)} prototypes")
        kind = UsdGeom.PointInstancer
        places = np.array(
            instancer.ComputeInstanceTransformsAtTime(self.time, self.time, kind.ExcludeProtoXform, kind.IgnoreMask)
        )
        if len(places) != len(which):
            raise InputError(f"{path}: positions, orientations or scales do not fit {len(which)} protoIndices")
        places = places.reshape(-1, 4, 4).transpose(0, 2, 1)
        mask = np.array(instancer.ComputeMaskAtTime(self.time), bool)
        is_shown = mask if len(mask) else np.ones(len(which), bool)
        found: Placed = []
        for k, target in enumerate(targets):
            prototype = self.stage.GetPrimAtPath(target)
            if not prototype:
                raise InputError(f"{path}: there is no prototype {target}")
            chosen = places[(which == k) & is_shown]
            image = UsdGeom.Imageable(prototype)
            if not len(chosen) or (image and image.ComputeVisibility(self.time) == UsdGeom.Tokens.invisible):
                continue
            for drawable, inner in self.at(prototype, BELOW_PROTOTYPE):
                if len(chosen) * len(inner) > TOO_MANY:
                    raise InputError(f"{path}: more than {TOO_MANY:,} instances of {drawable.name}")
                found.append((drawable, (chosen[:, None] @ inner[None]).reshape(-1, 4, 4)))
        return found

    def mesh(self, prim: Usd.Prim) -> Placed:
        """A mesh, one drawable for each material on it."""
        triangles = read_triangles(prim, self.time)
        if triangles is None:
            return []
        rest = np.ones(len(triangles.faces), bool)
        found: Placed = []
        for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
            chosen = np.isin(triangles.polygon, np.array(subset.GetIndicesAttr().Get(self.time) or [], np.int64))
            rest &= ~chosen
            found.append((self.drawable(prim, subset.GetPrim(), triangles, chosen), np.eye(4)[None]))
        found.append((self.drawable(prim, prim, triangles, rest), np.eye(4)[None]))
        return [item for item in found if len(item[0].faces)]

    def drawable(self, prim: Usd.Prim, bound: Usd.Prim, triangles: Triangles, chosen: NDArray[np.bool_]) -> Drawable:
        surface = surface_of(bound, self.surfaces)
        uv = None if surface.texture is None else triangles.uv(surface.st)
        if uv is not None:
            uv = uv @ surface.uv_matrix[:2, :2].T + surface.uv_matrix[:2, 2]
        return Drawable(
            name=str(bound.GetPath()),
            points=triangles.points,
            faces=triangles.faces[chosen],
            uv=uv,
            normals=triangles.normals,
            texture=surface.texture if uv is not None else None,
            colour=surface.colour,
            alpha_threshold=surface.alpha_threshold,
            is_leaf=is_foliage(prim, surface.name),
        )

    def local(self, prim: Usd.Prim) -> NDArray[np.float64]:
        """From a prim's space to its parent's (4, 4), for column vectors."""
        matrix, is_reset = self.xforms.GetLocalTransformation(prim)
        if is_reset:  # its transform is meant in world space
            matrix = matrix * self.xforms.GetParentToWorldTransform(prim).GetInverse()
        return _matrix(matrix)

    def is_drawn(self, prim: Usd.Prim) -> bool:
        """Whether a prim's purpose is to be seen in a final picture."""
        return UsdGeom.Imageable(prim).ComputePurpose() in (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)


def _matrix(gf: object) -> NDArray[np.float64]:
    """USD's matrix for row vectors as ours (4, 4) for column vectors."""
    return np.array(gf, float).T


def _moved(found: Placed, matrix: NDArray[np.float64]) -> Placed:
    return [(drawable, matrix @ places) for drawable, places in found]


def _merge(found: Iterable[tuple[Drawable, NDArray[np.float64]]]) -> Placed:
    """The same drawables with all their places together, in order of first appearance."""
    by_drawable: dict[int, tuple[Drawable, list[NDArray[np.float64]]]] = {}
    for drawable, places in found:
        by_drawable.setdefault(id(drawable), (drawable, []))[1].append(places)
    return [(drawable, np.concatenate(places)) for drawable, places in by_drawable.values()]


def _with_places(drawable: Drawable, places: NDArray[np.float64]) -> Drawable:
    return Drawable(**{**vars(drawable), "transforms": places})


def _to_metres_y_up(stage: Usd.Stage) -> NDArray[np.float64]:
    """From the stage's world to ours (4, 4)."""
    world = np.diag([UsdGeom.GetStageMetersPerUnit(stage)] * 3 + [1.0])
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z:
        world = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]]) @ world
    return world
