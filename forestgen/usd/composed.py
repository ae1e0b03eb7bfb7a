"""A written tree or scene, opened with chosen variants: its levels of detail, flattened, and its materials."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from pxr import Sdf, Usd, UsdShade

from forestgen.errors import InputError
from forestgen.render.drawable import Drawable
from forestgen.tree.joined import joined
from forestgen.tree.model import Mesh
from forestgen.usd.flatten import flattened
from forestgen.usd.layers import open_stage
from forestgen.usd.read import stage_drawables
from forestgen.usd.variants import ALL, LOD_SET, level_name


@dataclass(frozen=True, eq=False)
class Part:
    """All that wears one material in one component: one mesh, in the world of the stage."""

    component: str  # the component's name, unlike that of any other
    owner: Sdf.Path  # the component's prim
    name: str  # what the mesh is to be called
    material: Sdf.Path  # in the stage
    drawables: tuple[Drawable, ...]  # what it is made of

    @cached_property
    def mesh(self) -> Mesh:
        """The drawables flattened, one after the other."""
        return joined([flattened(one) for one in self.drawables])


class Composed:
    """A stage of ours in memory, with variants selected; nothing that is on disk changes."""

    def __init__(self, path: Path, selections: Mapping[str, str] | None = None) -> None:
        """Open a stage and select `selections` (variant set -> variant) on every prim that has the set.

        Raises:
            InputError: no such file, or no prim has such a set or variant.
        """
        self.path = path
        self.stage = open_stage(path)
        errors = self.stage.GetCompositionErrors()
        if errors:
            raise InputError(f"{path}: {errors[0]}")
        self.root = self.stage.GetDefaultPrim()
        if not self.root:
            raise InputError(f"{path}: has no default prim; expected a tree or a scene that was built: build it again")
        self.stage.SetEditTarget(self.stage.GetSessionLayer())
        for name, variant in (selections or {}).items():
            self.select(name, variant)

    @property
    def name(self) -> str:
        """The default prim's name."""
        return str(self.root.GetName())

    @property
    def is_tree(self) -> bool:
        """Whether it is one component, not a scene of many."""
        return bool(Usd.ModelAPI(self.root).GetKind() == "component")

    def n_levels(self) -> int:
        """How many levels of detail the tree with the most of them has; 1 where there is no choice."""
        return max([1, *(len(_levels(prim)) for prim in self._with_set(LOD_SET))])

    def select(self, name: str, variant: str) -> None:
        """Select a variant on every prim that has the set.

        Raises:
            InputError: none has the set, or none of them the variant.
        """
        prims = list(self._with_set(name))
        if not prims:
            sets = sorted({known for prim in self._models() for known in prim.GetVariantSets().GetNames()})
            raise InputError(f"{self.path}: there is no variant set {name!r}; it has {', '.join(sets) or 'none'}")
        known = sorted({one for prim in prims for one in prim.GetVariantSet(name).GetVariantNames()})
        if variant not in known:
            raise InputError(f"{self.path}: variant set {name!r} has no {variant!r}; it has {', '.join(known)}")
        having = [prim for prim in prims if variant in prim.GetVariantSet(name).GetVariantNames()]
        self._choose(name, {prim.GetPath(): variant for prim in having})

    def select_known(self, selections: Mapping[str, str]) -> None:
        """Select those of `selections` that are there: a tree of a scene may lack one that another has."""
        for name, variant in selections.items():
            if any(variant in prim.GetVariantSet(name).GetVariantNames() for prim in self._with_set(name)):
                self.select(name, variant)

    def select_level(self, k: int) -> None:
        """Select level of detail k; a tree of a scene that has fewer shows its last.

        Raises:
            InputError: no tree has so many.
        """
        if not 0 <= k < self.n_levels():
            raise InputError(f"{self.path}: there is no level of detail {k}; it has 0 to {self.n_levels() - 1}")
        levels = {prim.GetPath(): _levels(prim) for prim in self._with_set(LOD_SET)}
        self._choose(LOD_SET, {path: names[min(k, len(names) - 1)] for path, names in levels.items()})

    def drawables(self) -> list[Drawable]:
        """What shows: instances are places of one drawable.

        Raises:
            InputError: geometry or a texture is broken or missing, or nothing shows.
        """
        found = stage_drawables(self.stage, self.root.GetPath())
        if not found:
            raise InputError(f"{self.path}: there is nothing to see in it; expected meshes: build it again")
        return found

    def parts(self, drawables: list[Drawable]) -> list[Part]:
        """Drawables flattened and joined, one part a material and component, in the order of the stage.

        Raises:
            InputError: a mesh has no material.
        """
        groups: dict[tuple[Sdf.Path, Sdf.Path], list[Drawable]] = {}
        for drawable in drawables:
            bound = self.stage.GetPrimAtPath(drawable.name)
            material, _ = UsdShade.MaterialBindingAPI(bound).ComputeBoundMaterial()
            if not material:
                raise InputError(f"{self.path}: {drawable.name} has no material; expected one on every mesh")
            groups.setdefault((self._component(bound), material.GetPath()), []).append(drawable)
        names = _unique([component.name for component, _ in groups], [component for component, _ in groups])
        return [
            Part(name, owner, _mesh_name(material), material, tuple(group))
            for name, ((owner, material), group) in zip(names, groups.items(), strict=True)
        ]

    def flat_layer(self) -> Sdf.Layer:
        """The stage as one layer: no arcs, no variants, nothing inactive; paths of files are absolute.

        Instances stay: they refer to prims of the layer.
        """
        layer = self.stage.Flatten(addSourceFileComment=False)
        _drop_inactive(layer.pseudoRoot)
        return layer

    def _choose(self, name: str, chosen: Mapping[Sdf.Path, str]) -> None:
        """Select variants of a set, by prim: all at once, or ten thousand trees would be composed as often."""
        layer = self.stage.GetSessionLayer()
        with Sdf.ChangeBlock():
            for path, variant in chosen.items():
                Sdf.CreatePrimInLayer(layer, path).variantSelections[name] = variant

    def _component(self, prim: Usd.Prim) -> Sdf.Path:
        while prim and prim != self.root and Usd.ModelAPI(prim).GetKind() != "component":
            prim = prim.GetParent()
        return prim.GetPath()

    def _models(self) -> Iterator[Usd.Prim]:
        """The root and the prims below it down to components, which alone have variants."""
        prims = iter(Usd.PrimRange(self.root))
        for prim in prims:
            yield prim
            if Usd.ModelAPI(prim).GetKind() == "component":
                prims.PruneChildren()

    def _with_set(self, name: str) -> Iterator[Usd.Prim]:
        return (prim for prim in list(self._models()) if name in prim.GetVariantSets().GetNames())


def _levels(prim: Usd.Prim) -> list[str]:
    """The variants of a prim that are levels of detail, in their order."""
    names = set(prim.GetVariantSet(LOD_SET).GetVariantNames()) - {ALL}
    return [level_name(k) for k in range(len(names)) if level_name(k) in names]


def _mesh_name(material: Sdf.Path) -> str:
    """What a mesh is called after its material, in the words of a written tree."""
    known = {"bark": "branches", "leaf": "leaves"}
    return str(known.get(material.name, material.name))


def _unique(names: list[str], owners: list[Sdf.Path]) -> list[str]:
    """Names of components, told apart by `_2` where two of them have one name."""
    taken: dict[Sdf.Path, str] = {}
    for name, owner in zip(names, owners, strict=True):
        if owner not in taken:
            free, k = name, 2
            while free in taken.values():
                free, k = f"{name}_{k}", k + 1
            taken[owner] = free
    return [taken[owner] for owner in owners]


def _drop_inactive(parent: Sdf.PrimSpec) -> None:
    for prim in list(parent.nameChildren):
        if prim.active:
            _drop_inactive(prim)
        else:
            del parent.nameChildren[prim.name]
