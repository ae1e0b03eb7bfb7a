"""A tree that a build wrote, as a file of another kind: which kind, its name says."""

from __future__ import annotations

from pathlib import Path

from forestgen.errors import InputError
from forestgen.export.gltf import write_glb
from forestgen.export.obj import write_obj
from forestgen.usd.read_model import read_card_atlas, read_levels, read_model

SUFFIXES = (".glb", ".obj")


def export_tree(folder: Path, target: Path, *, level: int | None = None, instancing: bool = True) -> Path:
    """Write the tree in OUT/trees/NAME as `target`, a .glb or .obj.

    A .glb holds all levels of detail, or just `level`; a .obj holds one, the full tree unless said.
    `instancing` is for .glb: without it leaves are one mesh.

    Raises:
        InputError: the folder is no written tree or a file of it is missing, there is no such level,
            or `target` is of another kind or a folder.
        OSError: the target could not be written; an earlier one is as it was.
    """
    folder, target = Path(folder), Path(target)
    suffix = target.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{target}: expected a name that ends in {' or '.join(SUFFIXES)}")
    model, levels, card_rgba = read_model(folder), read_levels(folder), read_card_atlas(folder)
    if level is not None and not 0 <= level < len(levels):
        raise InputError(f"{folder}: has levels of detail 0 to {len(levels) - 1}, not {level}")
    if suffix == ".obj":
        return write_obj(model, levels[level or 0], target, card_rgba=card_rgba)
    chosen = levels if level is None else levels[level : level + 1]
    return write_glb(model, chosen, target, card_rgba=card_rgba, instancing=instancing)
