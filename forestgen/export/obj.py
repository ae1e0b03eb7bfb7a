"""Trees as Wavefront OBJ with MTL and pictures: for programs that read nothing newer.

    oak.obj                groups branches and leaves (leaf_cards), y up, metres
    oak.mtl                materials bark and leaf (leaf_cards)
    oak_bark.png           map_Kd, repeats
    oak_leaf.png           map_Kd with the cut-out in its alpha
    oak_leaf_mask.png      map_d: the cut-out as grey and as alpha, since readers differ in which they look at

OBJ knows no instances: each leaf is written out, but all leaves of one prototype share its texture
coordinates. trimesh's writer gives each of them its own and knows neither groups nor map_d.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forestgen.export.places import leaf_places
from forestgen.export.subject import Subject, require_target
from forestgen.png import png_bytes
from forestgen.scene.names import identifier
from forestgen.staging import install, staging
from forestgen.tree.level import Level
from forestgen.tree.model import LeafPrototype, Leaves, Mesh, TreeModel
from forestgen.tree.srgb import linear_from_srgb
from forestgen.usd.flatten import flat_leaves


def write_obj(model: TreeModel, level: Level, path: Path, *, card_rgba: NDArray[np.uint8] | None = None) -> Path:
    """Write one level of a tree as `path`.obj, its materials and pictures beside it. Same tree, same bytes.

    The files beside it are named after `path`, made an identifier: blanks would end a name in OBJ.

    Raises:
        InputError: the level has nothing to draw or lacks its texture, or `path` is no .obj or a folder.
        OSError: a file could not be written; earlier ones are as they were.
    """
    path = Path(path)
    require_target(path, ".obj")
    subject = Subject(model, (level,), card_rgba)
    stem = identifier(path.stem) or "tree"
    materials, pictures = _materials(subject, level, stem)
    files = {f"{stem}.mtl": materials.encode(), **{name: png_bytes(image) for name, image in pictures.items()}}
    with staging(path.parent) as work:
        with (work / path.name).open("w", encoding="ascii", newline="\n") as file:
            file.writelines(_lines(level, stem))
        for name, data in files.items():
            (work / name).write_bytes(data)
        install(work, path.parent, [path.name, *files])
    return path


def _lines(level: Level, stem: str) -> Iterator[str]:
    """The text of the OBJ, in large pieces."""
    yield f"# forestgen\nmtllib {stem}.mtl\no {stem}\n"
    placed = n_uv = 0
    for group, material, mesh in (("branches", "bark", level.mesh), ("leaf_cards", "leaf_cards", level.cards)):
        if len(mesh.faces):
            yield from _vertices(mesh, mesh.uv)
            yield f"g {group}\nusemtl {material}\n"
            yield _faces(mesh.faces + placed, mesh.faces + n_uv)
            placed, n_uv = placed + len(mesh.points), n_uv + len(mesh.uv)
    if len(level.leaves):
        flat, _ = flat_leaves(level.leaves, level.prototypes)
        yield from _vertices(flat, np.concatenate([leaf.uv for leaf in level.prototypes]))
        yield "g leaves\nusemtl leaf\n"
        yield _faces(flat.faces + placed, _uv_faces(level.leaves, level.prototypes) + n_uv)


def _uv_faces(leaves: Leaves, prototypes: Sequence[LeafPrototype]) -> NDArray[np.int64]:
    """Corners (F, 3) of the flat leaves' triangles among the prototypes' texture coordinates."""
    first = np.cumsum([0, *(len(leaf.uv) for leaf in prototypes)])
    counts = [len(places) for places in leaf_places(leaves, len(prototypes))]
    return np.concatenate([np.tile(leaf.faces + first[k], (counts[k], 1)) for k, leaf in enumerate(prototypes)])


def _vertices(mesh: Mesh, uv: NDArray[np.float64]) -> Iterator[str]:
    """Places to a hundredth of a millimetre, normals, and texture coordinates with v upward, as OBJ has it."""
    yield _rows("v %.5f %.5f %.5f\n", mesh.points)
    yield _rows("vt %.6f %.6f\n", uv)
    yield _rows("vn %.4f %.4f %.4f\n", mesh.normals)


def _faces(corner: NDArray[np.int64], uv: NDArray[np.int64]) -> str:
    """Triangles of corners (F, 3), each with its place, texture coordinate and normal; OBJ counts from one."""
    return _rows("f %d/%d/%d %d/%d/%d %d/%d/%d\n", np.stack([corner, uv, corner], axis=2).reshape(-1, 9) + 1)


def _rows(form: str, rows: NDArray[np.float64] | NDArray[np.int64]) -> str:
    return form * len(rows) % tuple(rows.ravel().tolist())


def _materials(subject: Subject, level: Level, stem: str) -> tuple[str, dict[str, NDArray[np.uint8]]]:
    """The MTL's text and the pictures (by file name) that it names."""
    text, pictures = ["# forestgen\n"], {}
    if len(level.mesh.faces):
        bark = subject.model.bark.rgb
        if subject.has_plain_bark:
            text.append(_material("bark", linear_from_srgb(bark[0, 0] / 255)))
        else:
            pictures[f"{stem}_bark.png"] = bark
            text.append(_material("bark", np.ones(3)) + f"map_Kd {stem}_bark.png\n")
    cut_outs = [
        ("leaf", subject.model.atlas.rgba, len(level.leaves)),
        ("leaf_cards", subject.card_rgba, len(level.cards.faces)),
    ]
    for name, rgba, is_used in cut_outs:
        if is_used and rgba is not None:
            pictures[f"{stem}_{name}.png"] = rgba
            pictures[f"{stem}_{name}_mask.png"] = np.repeat(rgba[..., 3:], 4, axis=2)
            text.append(_material(name, np.ones(3)) + f"map_Kd {stem}_{name}.png\nmap_d {stem}_{name}_mask.png\n")
    return "\n".join(text), pictures


def _material(name: str, colour: NDArray[np.float64]) -> str:
    """A matt surface; without highlights, since MTL's have no energy to keep."""
    return f"newmtl {name}\nKd {colour[0]:.4f} {colour[1]:.4f} {colour[2]:.4f}\nKs 0 0 0\nd 1\nillum 1\n"
