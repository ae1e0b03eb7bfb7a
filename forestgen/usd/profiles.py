"""Profiles: a written tree or scene made over for one kind of reader.

    usd       as it is, copied whole: levels, variants, instancers, guides, cameras
    blender   one level, variants chosen, one payload layer; leaves stay instances
    web       one .usdz: one level, one mesh a material; no instances, variants or payloads
    arkit     the same by ARKit's rules, for AR Quick Look
    unreal    variant set LOD as Unreal's importer reads it: one mesh a level, named after its variant

All is made beside and moved into place; the same bytes for the same source. Growth is left out of all
but `usd`, unless it is selected (`variants={"growth": "animated"}`) for `blender`.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from pxr import Sdf

from forestgen.errors import InputError
from forestgen.staging import install, staging
from forestgen.usd.composed import Composed
from forestgen.usd.package import dependencies
from forestgen.usd.profile_blender import write_blender
from forestgen.usd.profile_flat import write_flat
from forestgen.usd.profile_unreal import write_unreal

TRIANGLES = {"web": 200_000, "arkit": 100_000}  # arkit: what Apple asks for (WWDC 2018, session 603)
ALWAYS_KEPT = ("cameras.usda", "growing.usda", "skeleton.json")  # beside a tree, not needed by it
PROFILES = ("usd", "blender", "web", "arkit", "unreal")
FLAT = ("web", "arkit")

Convert = Callable[[Path, Path], Path]  # a tree's root layer -> the folder of the new one


def write_profile(
    source: Path,
    target: Path,
    profile: str,
    *,
    level: int | None = None,
    variants: Mapping[str, str] | None = None,
) -> Path:
    """Write a tree (OUT/trees/NAME) or a scene (OUT) for a reader into the folder `target`; give its file.

    `level`: the level of detail of `blender` (0 unless said), `web` and `arkit` (unless said, the finest of
    at most so many triangles, instances counted out: 200,000 for `web`, 100,000 for `arkit`). `variants`:
    variant set -> variant, selected before; not of `usd`, which keeps all.

    Raises:
        InputError: no such profile, level or variant, no tree or scene there, a file of it is missing or
            broken, or an option that the profile does not know.
        OSError: a file could not be written; what was in `target` is as it was.
    """
    if profile not in PROFILES:
        raise InputError(f"there is no profile {profile!r}; it must be one of {', '.join(PROFILES)}")
    _refuse_options(profile, level, variants)
    source, target = Path(source).resolve(), Path(target)
    root = find_root(source)
    if target.resolve() == root.parent:
        raise InputError(f"{target}: is what the profile is made from; choose another folder")
    if level is not None or variants:
        _check_choice(root, level, variants)
    with staging(target) as work:
        made = work / "made"
        made.mkdir()
        if profile in FLAT:
            file = write_flat(root, made, variants or {}, level, TRIANGLES[profile])
        else:
            file = _copied(root, made, _converter(profile, level or 0, variants or {}))
        install(made, target, sorted(entry.name for entry in made.iterdir()))
    return target / file.name


def find_root(source: Path) -> Path:
    """The root layer of the tree or scene in a folder, or `source` itself where it is one.

    Raises:
        InputError: there is none, or its name is none that USD takes.
    """
    if source.is_file():
        return source
    if not source.is_dir():
        raise InputError(f"{source}: there is no such folder; expected OUT/trees/NAME of a tree, or OUT of a scene")
    own = source / f"{source.name}.usda"
    if own.is_file():
        return own
    others = sorted(path for path in source.glob("*.usda") if path.name not in ALWAYS_KEPT)
    if len(others) == 1 and (source / "trees").is_dir():
        return others[0]
    if others:
        raise InputError(
            f"{source}: holds {others[0].name}, not {own.name}; a tree's folder must keep the tree's name:"
            f" rename it to {others[0].stem}"
        )
    raise InputError(f"{source}: holds no {own.name} and no scene; expected OUT/trees/NAME or OUT of a build")


def _refuse_options(profile: str, level: int | None, variants: Mapping[str, str] | None) -> None:
    if level is not None and profile in ("usd", "unreal"):
        raise InputError(f"--level: profile {profile!r} holds all levels of detail; leave it out")
    if variants and profile == "usd":
        raise InputError("--variant: profile 'usd' keeps all variants; leave it out")


def _check_choice(root: Path, level: int | None, variants: Mapping[str, str] | None) -> None:
    """Open the tree or scene once with all that is chosen, before anything is made."""
    composed = Composed(root, variants)
    if level is not None:
        composed.select_level(level)


def _converter(profile: str, level: int, variants: Mapping[str, str]) -> Convert | None:
    """What makes a tree over; None where it is copied."""
    if profile == "blender":
        return lambda tree, folder: write_blender(tree, folder, variants, level)
    if profile == "unreal":
        return lambda tree, folder: write_unreal(tree, folder, variants)
    return None


def _copied(root: Path, made: Path, convert: Convert | None) -> Path:
    """Copy a root layer and all that it needs into `made`; the trees among that are made over, if there is a way.

    Raises:
        InputError: a file is missing, or no tree is there to be made over.
    """
    home = root.parent
    files = dependencies(root, home)
    trees = [file for file in files if is_tree(home / file)]
    if convert and not trees:
        raise InputError(
            f"{root}: there is no tree in it; expected NAME/NAME.usda as built: a folder keeps its tree's name"
        )
    folders = {tree.parent for tree in trees}
    kept = ALWAYS_KEPT if convert is None else ALWAYS_KEPT[:1]  # of what is made over only the cameras fit
    wanted = {folder / name for folder in folders for name in kept if (home / folder / name).is_file()}
    for extra in sorted(wanted):
        if extra.suffix == ".usda":
            wanted.update(path for path in dependencies(home / extra, home) if convert is None)
    wanted.update(file for file in files if convert is None or not any(file.is_relative_to(one) for one in folders))
    for file in sorted(wanted):
        (made / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(home / file, made / file)
    if convert:
        for tree in trees:
            (made / tree.parent).mkdir(parents=True, exist_ok=True)
            convert(home / tree, made / tree.parent)
    return made / root.name


def is_tree(path: Path) -> bool:
    """Whether a file is the root layer of a component that this program wrote: NAME/NAME.usda."""
    if path.suffix != ".usda" or path.stem != path.parent.name:
        return False
    layer = Sdf.Layer.OpenAsAnonymous(os.fspath(path))
    return bool(layer and layer.GetPrimAtPath(f"/{layer.defaultPrim}").kind == "component")
