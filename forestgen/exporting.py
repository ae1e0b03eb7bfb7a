"""The `export` command's work: a written tree or scene, made over for one reader, within budgets.

    usd, blender, web, arkit, unreal   USD as each reads it best (usd/profiles.py)
    glb                                glTF binary: levels of detail, leaves as instances
    obj                                OBJ and MTL of one level of one tree

What is exported is what was written: trees are read back from their folders.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from forestgen.build_record import arrays_name, stage_name
from forestgen.errors import InputError
from forestgen.export.gltf import write_glb, write_scene_glb
from forestgen.export.obj import write_obj
from forestgen.export.subject import Subject
from forestgen.finishing import Finish, coarsening, finish
from forestgen.reference import write_provenance
from forestgen.tree.level import Level, full_level
from forestgen.tree.lod import fit_level
from forestgen.tree.model import TreeModel
from forestgen.tree.seasons import SEASONS
from forestgen.usd.lights import LIGHT_SET
from forestgen.usd.looks import LOOK_SET
from forestgen.usd.profiles import FLAT, find_root, is_tree, write_profile
from forestgen.usd.profiles import PROFILES as USD_PROFILES
from forestgen.usd.read_forest import read_forest
from forestgen.usd.read_model import read_card_atlas, read_levels, read_model, read_seasons
from forestgen.usd.rig import write_rig
from forestgen.usd.seasons import SEASON_SET
from forestgen.usd.tree_asset import write_tree_asset
from forestgen.usd.variants import variant_sets

PROFILES = (*USD_PROFILES, "glb", "obj")


@dataclass(frozen=True)
class Wishes:
    """What a user asks of an export beside its profile."""

    level: int | None = None  # the level of detail, where the profile holds one
    max_triangles: int | None = None  # of the finest level, leaves counted out
    max_instances: int | None = None  # leaves of the finest level
    season: str | None = None  # as photographed unless one is named; a tree of a scene may lack it
    variants: Mapping[str, str] = field(default_factory=dict)  # variant set -> variant
    instancing: bool = True  # of glb: leaves as instances
    rig: bool = False  # a skinned tree beside the profile's file

    @property
    def has_budget(self) -> bool:
        return self.max_triangles is not None or self.max_instances is not None


def export(source: Path, target: Path, profile: str, wishes: Wishes | None = None) -> list[Path]:
    """Export a tree (OUT/trees/NAME) or a scene (OUT) into the folder `target`; gives the files to open.

    Raises:
        InputError: no such profile, tree, level or variant, a wish that the profile does not know, a file
            that is missing or broken, or a budget that no level keeps; nothing was written.
        OSError: a file could not be written; what was in `target` is as it was.
    """
    wishes = wishes or Wishes()
    _check(profile, wishes)
    if wishes.season is not None and profile in USD_PROFILES:
        wishes = replace(wishes, season=None, variants={**wishes.variants, SEASON_SET: wishes.season})
    root = find_root(Path(source).resolve())
    if wishes.rig and not is_tree(root):
        raise InputError(f"{source}: --rig skins one tree; give its folder, OUT/trees/NAME")
    if profile == "glb":
        return [_glb(root, Path(target), wishes)]
    if profile == "obj":
        return [_obj(root, Path(target), wishes)]
    return _usd(root, Path(target), profile, wishes)


def parse_variants(words: Sequence[str]) -> dict[str, str]:
    """SET=VARIANT as users write it.

    Raises:
        InputError: one has another form, or a set comes twice.
    """
    chosen: dict[str, str] = {}
    for word in words:
        name, equals, variant = word.partition("=")
        if not (name and equals and variant) or name in chosen:
            raise InputError(f"--variant: expected SET=VARIANT, each set once, came {word!r}; such as season=autumn")
        chosen[name] = variant
    return chosen


def _check(profile: str, wishes: Wishes) -> None:
    """Refuse a profile that there is not, and wishes that it does not know."""
    if profile not in PROFILES:
        raise InputError(f"--profile: expected one of {', '.join(PROFILES)}, came {profile!r}")
    for name, budget in (("--max-triangles", wishes.max_triangles), ("--max-instances", wishes.max_instances)):
        if budget is not None and budget < 0:
            raise InputError(f"{name}: expected 0 or more, came {budget}")
    if wishes.season is not None and wishes.season not in SEASONS:
        raise InputError(f"--season: expected one of {', '.join(SEASONS)}, came {wishes.season!r}")
    if wishes.season is not None and SEASON_SET in wishes.variants:
        raise InputError(f"--season: --variant {SEASON_SET}={wishes.variants[SEASON_SET]} says it too; leave one out")
    refused = {
        "--season": wishes.season is not None and profile == "usd",  # which keeps all variants
        "--variant": bool(wishes.variants) and profile in ("glb", "obj"),
        "--no-instancing": not wishes.instancing and profile != "glb",
        "--rig": wishes.rig and profile != "usd",
    }
    for name, is_refused in refused.items():
        if is_refused:
            raise InputError(f"{name}: profile {profile!r} has no use for it; leave it out")


def _usd(root: Path, target: Path, profile: str, wishes: Wishes) -> list[Path]:
    level = wishes.level
    with ExitStack() as stack:
        if wishes.has_budget:
            root = _refitted(root, Path(stack.enter_context(TemporaryDirectory())), wishes)
            level = 0 if level is None and profile in FLAT else level
        files = [write_profile(root.parent, target, profile, level=level, variants=wishes.variants)]
        if wishes.rig:
            files.append(write_rig(read_model(root.parent), target, root.stem))
    return files


def _refitted(root: Path, work: Path, wishes: Wishes) -> Path:
    """The tree or scene again below `work`, its finest levels within the budgets."""
    if is_tree(root):
        _refit(root.parent, work / root.stem, wishes)
        return work / root.stem / root.name
    scene = work / "scene"
    scene.mkdir()
    for name in (stage_name(root.stem), arrays_name(root.stem)):
        if (root.parent / name).is_file():
            shutil.copyfile(root.parent / name, scene / name)
    for name in read_forest(root).prototypes:
        _refit(root.parent / "trees" / name, scene / "trees" / name, wishes)
    return scene / root.name


def _refit(folder: Path, target: Path, wishes: Wishes) -> None:
    """Write the tree of a folder again, its finest level within the budgets, coarser ones made from that."""
    model, _ = _fitted(read_model(folder), wishes)
    sets = variant_sets(folder / f"{folder.name}.usda")
    write_tree_asset(model, target, finish(model, Finish(LIGHT_SET in sets, LOOK_SET in sets)))
    write_provenance(model, target / "reference")
    if (folder / "cameras.usda").is_file():
        shutil.copyfile(folder / "cameras.usda", target / "cameras.usda")


def _within(folder: Path, wishes: Wishes) -> tuple[TreeModel, tuple[Level, ...]]:
    """A tree and its levels, the finest within the budgets and from the level that is wished on."""
    model, levels = read_model(folder, wishes.season), read_levels(folder, wishes.season)
    if wishes.has_budget:
        model, finest = _fitted(model, wishes)
        levels = (finest, *coarsening(model, levels[1:]))
    if wishes.level is not None:
        if not 0 <= wishes.level < len(levels):
            raise InputError(f"--level: {folder} has the levels 0 to {len(levels) - 1}, came {wishes.level}")
        levels = levels[wishes.level :]
    return model, levels


def _fitted(model: TreeModel, wishes: Wishes) -> tuple[TreeModel, Level]:
    """A tree within the budgets, and itself as the full level."""
    finest = fit_level(model, max_triangles=wishes.max_triangles, max_instances=wishes.max_instances)
    prototypes = finest.prototypes if len(finest.leaves) else model.atlas.prototypes
    atlas = replace(model.atlas, prototypes=prototypes)
    fitted = replace(model, mesh=finest.mesh, leaves=finest.leaves, atlas=atlas)
    return fitted, full_level(fitted)


def _glb(root: Path, target: Path, wishes: Wishes) -> Path:
    path = target / f"{root.stem}.glb"
    if is_tree(root):
        tree = _subject(root.parent, wishes)
        return write_glb(tree.model, tree.levels, path, card_rgba=tree.card_rgba, instancing=wishes.instancing)
    forest = read_forest(root)
    folders = {name: root.parent / "trees" / name for name in forest.prototypes}
    wear = [name for name, folder in folders.items() if wishes.season in read_seasons(folder)] if wishes.season else []
    if wishes.season and not wear:
        raise InputError(f"--season: no tree of {root} has {wishes.season!r}; build it again where trees get seasons")
    trees = {
        name: _subject(folder, wishes if name in wear else replace(wishes, season=None))
        for name, folder in folders.items()
    }
    return write_scene_glb(trees, forest, path, instancing=wishes.instancing)


def _subject(folder: Path, wishes: Wishes) -> Subject:
    model, levels = _within(folder, wishes)
    return Subject(model, levels, read_card_atlas(folder, wishes.season))


def _obj(root: Path, target: Path, wishes: Wishes) -> Path:
    if not is_tree(root):
        raise InputError(f"{root.parent}: OBJ holds one tree; give its folder, OUT/trees/NAME, or use --profile glb")
    tree = _subject(root.parent, wishes)
    path = target / f"{root.stem}.obj"
    return write_obj(tree.model, tree.levels[0], path, card_rgba=tree.card_rgba)
