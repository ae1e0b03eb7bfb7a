"""The manifest: scene.toml becomes a Scene, or one line that says what is wrong with it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from forestgen.errors import InputError
from forestgen.reading import checked, key_path, quoted, read_toml, require_file, suggestion
from forestgen.scene.folder_settings import located, shown_settings
from forestgen.scene.names import prim_names
from forestgen.scene.paths import Location, scene_root
from forestgen.scene.tables import DEFAULT_METHOD, CopyTable, Manifest, TreeTable, ViewTable
from forestgen.tree.methods import Method, configure


@dataclass(frozen=True)
class ViewSpec:
    """One photo of a tree and where its camera stood."""

    photo: Path
    strokes: Path
    azimuth: float = 0.0  # radians about +Y, anticlockwise
    elevation: float = 0.0  # radians above the horizon
    scale: float = 1.0  # factor on the pixels per metre
    root: tuple[float, float] | None = None  # px; None = the trunk stroke's first point
    focal_px: float | None = None  # None = orthographic


@dataclass(frozen=True)
class TreeSpec:
    """A tree to build."""

    name: str  # as given
    prim_name: str  # of its prim, folder and files
    height: float  # m
    method: Method
    method_name: str
    seed: int
    views: tuple[ViewSpec, ...]
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m
    heading: float = 0.0  # radians about +Y
    stages: Mapping[str, str] = field(default_factory=dict)  # strategies chosen by name
    gates: Mapping[str, float] = field(default_factory=dict)  # those that the scene or the tree sets
    evergreen: bool = False  # green all year


@dataclass(frozen=True)
class CopySpec:
    """One more standing of a tree."""

    of: str  # the tree's name, as given
    position: tuple[float, float, float]  # m
    heading: float = 0.0  # radians about +Y
    scale: float = 1.0


@dataclass(frozen=True)
class Scene:
    """Which trees are built, and where they and their copies stand."""

    name: str
    seed: int
    path: Path  # the manifest; of a scene without one, the photo
    root: Path  # resolved; what a manifest names lies below it
    trees: tuple[TreeSpec, ...]
    copies: tuple[CopySpec, ...] = ()

    @property
    def prim_name(self) -> str:
        """The scene's name as a prim and file name."""
        return prim_names([self.name], fallback="scene")[0]

    def resolved(self) -> dict[str, Any]:
        """The manifest in its own form with every value written out; paths relative to the scene's root."""
        location = Location(self.path.parent, self.root)
        return {
            "scene": {"name": self.name, "seed": self.seed},
            "tree": [_tree_entry(tree, location) for tree in self.trees],
            "copy": [
                {"of": copy.of, "position": list(copy.position), "heading": _degrees(copy.heading), "scale": copy.scale}
                for copy in self.copies
            ],
        }


def load_scene(path: Path, root: Path | None = None) -> Scene:
    """Read a manifest. `root` widens the folder that its paths must stay in.

    Raises:
        InputError: the manifest, or a file that it names, is missing or wrong; the message gives file,
            key, what was expected, what came, and what to do.
    """
    path = Path(path)
    data = read_toml(path, "a scene manifest (TOML)")
    if data.get("scatter"):
        raise InputError(f"{path}: [[scatter]] is not built yet; place trees with [[tree]] and [[copy]] for now")
    manifest = checked(Manifest, data, str(path))
    location = Location(path.parent, scene_root(path, root))
    _configured(manifest.scene.method, {}, {}, f"{path}: scene.method")
    _check_names(manifest, path)
    names = [tree.name for tree in manifest.tree]
    prims = prim_names(names)
    return Scene(
        name=manifest.scene.name,
        seed=manifest.scene.seed,
        path=path,
        root=location.root,
        trees=tuple(
            _tree_spec(tree, manifest, k, prims[k], location, f"{path}: tree[{k + 1}] {quoted(tree.name)}")
            for k, tree in enumerate(manifest.tree)
        ),
        copies=tuple(_copy_spec(copy) for copy in manifest.copy_),
    )


def single_tree_scene(
    photo: Path,
    strokes: Path,
    *,
    height: float = 10.0,
    name: str | None = None,
    method: str = DEFAULT_METHOD,
    seed: int = 0,
    evergreen: bool = False,
) -> Scene:
    """A scene of one tree, at the origin, named after its photo.

    Raises:
        InputError: a file is missing, the height is not a positive number, or the method is unknown.
    """
    photo, strokes = Path(photo), Path(strokes)
    require_file(photo, "a photo")
    require_file(strokes, "a stroke set")
    table = {"name": photo.stem if name is None else name, "height": height, "seed": seed, "method": method}
    tree = checked(TreeTable, table, "forestgen tree")
    spec = TreeSpec(
        name=tree.name,
        prim_name=prim_names([tree.name])[0],
        height=tree.height,
        method=_configured(method, {}, {}, "method"),
        method_name=method,
        seed=seed,
        views=(ViewSpec(photo, strokes),),
        evergreen=evergreen,
    )
    return Scene(name=tree.name, seed=seed, path=photo, root=photo.resolve().parent, trees=(spec,))


def _check_names(manifest: Manifest, path: Path) -> None:
    """Raise InputError where there is no tree, two of one name, or a copy of none."""
    if not manifest.tree:
        raise InputError(f"{path}: the scene has no tree; add a [[tree]] with name, height, photo and strokes")
    first: dict[str, int] = {}
    for k, tree in enumerate(manifest.tree, 1):
        if first.setdefault(tree.name, k) != k:
            raise InputError(
                f"{path}: tree[{k}] {quoted(tree.name)}: name: tree[{first[tree.name]}] has the same; rename one,"
                " or place the one tree again with [[copy]]"
            )
    for k, copy in enumerate(manifest.copy_, 1):
        if copy.of not in first:
            raise InputError(f"{path}: copy[{k}].of: no tree is named {quoted(copy.of)}; {suggestion(copy.of, first)}")


def _tree_spec(
    tree: TreeTable, manifest: Manifest, index: int, prim_name: str, location: Location, where: str
) -> TreeSpec:
    method_name = tree.method or manifest.scene.method
    method = located(_configured(method_name, tree.stages, tree.settings, where), location, where)
    views = _views(tree, location, where)
    _check_number(views, method, f"method '{method_name}'", where)
    _check_directions(tree.view, where)
    x, y, z = tree.position
    return TreeSpec(
        name=tree.name,
        prim_name=prim_name,
        height=tree.height,
        method=method,
        method_name=method_name,
        seed=manifest.scene.seed + index if tree.seed is None else tree.seed,
        views=views,
        position=(x, y, z),
        heading=math.radians(tree.heading),
        stages=tree.stages,
        gates=manifest.scene.gates.named() | tree.gates.named(),
        evergreen=tree.evergreen,
    )


def _views(tree: TreeTable, location: Location, where: str) -> tuple[ViewSpec, ...]:
    """The views of a tree: those of its [[tree.view]] tables, or the one of its own photo and strokes."""
    if tree.view:
        if tree.photo or tree.strokes:
            raise InputError(f"{where}: has both a photo of its own and [[tree.view]]; move it into a [[tree.view]]")
        return tuple(
            _view_spec(view, location, f"{where}: {key_path(('view', k), None)}") for k, view in enumerate(tree.view)
        )
    if tree.photo is None or tree.strokes is None:
        lacking = "photo" if tree.photo is None else "strokes"
        raise InputError(f"{where}: {lacking} is missing: expected photo and strokes, or one [[tree.view]] a photo")
    return (_view_spec(ViewTable(photo=tree.photo, strokes=tree.strokes), location, f"{where}: "),)


def _check_number(views: Sequence[ViewSpec], method: Method, what: str, where: str) -> None:
    """Raise InputError where a stage of the method takes fewer photos of a tree than there are."""
    for stage in fields(method):
        most = getattr(method, stage.name).most_views
        if most is not None and len(views) > most:
            raise InputError(
                f"{where}: view: {what} takes {most} photo{'s' * (most > 1)} of a tree in its stage '{stage.name}',"
                f" came {len(views)}; give {most}, or choose another method or another '{stage.name}'"
            )


def _check_directions(views: Sequence[ViewTable], where: str) -> None:
    """Raise InputError where two views look from one direction: the second photo would tell nothing of depth."""
    first: dict[tuple[float, float], int] = {}
    for k, view in enumerate(views, 1):
        direction = (round(view.azimuth % 360, 3) % 360, round(view.elevation, 3))
        if first.setdefault(direction, k) != k:
            raise InputError(
                f"{where}: view[{k}].azimuth: expected another direction than that of view[{first[direction]}],"
                f" came the same, {view.azimuth:g}; give the degrees by which the camera has moved about the tree"
            )


def _view_spec(view: ViewTable, location: Location, where: str) -> ViewSpec:
    dot = "" if where.endswith(" ") else "."
    return ViewSpec(
        photo=location.file(view.photo, f"{where}{dot}photo", "a photo"),
        strokes=location.file(view.strokes, f"{where}{dot}strokes", "a stroke set"),
        azimuth=math.radians(view.azimuth),
        elevation=math.radians(view.elevation),
        scale=view.scale,
        root=None if view.root is None else (view.root[0], view.root[1]),
        focal_px=view.focal_px,
    )


def _copy_spec(copy: CopyTable) -> CopySpec:
    x, y, z = copy.position
    return CopySpec(copy.of, (x, y, z), math.radians(copy.heading), copy.scale)


def _configured(
    name: str, stages: Mapping[str, str], settings: Mapping[str, Mapping[str, object]], where: str
) -> Method:
    try:
        return configure(name, stages, settings)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def _tree_entry(tree: TreeSpec, location: Location) -> dict[str, Any]:
    return {
        "name": tree.name,
        "height": tree.height,
        "evergreen": tree.evergreen,
        "position": list(tree.position),
        "heading": _degrees(tree.heading),
        "method": tree.method_name,
        "seed": tree.seed,
        "stages": dict(tree.stages),
        "settings": shown_settings(tree.method, location),
        "gates": dict(tree.gates),
        "view": [_view_entry(view, location) for view in tree.views],
    }


def _view_entry(view: ViewSpec, location: Location) -> dict[str, Any]:
    entry = {
        "photo": location.shown(view.photo),
        "strokes": location.shown(view.strokes),
        "azimuth": _degrees(view.azimuth),
        "elevation": _degrees(view.elevation),
        "scale": view.scale,
    }
    if view.root is not None:
        entry["root"] = list(view.root)
    if view.focal_px is not None:
        entry["focal_px"] = view.focal_px
    return entry


def _degrees(radians: float) -> float:
    return round(math.degrees(radians), 9)
