"""A tree's own arrays as things to draw: wood in its bark, leaves in any atlas, cards in theirs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forestgen.render.drawable import Drawable
from forestgen.tree.level import Level
from forestgen.tree.model import Bark, LeafPrototype, Mesh
from forestgen.tree.places import leaf_matrices


def level_drawables(
    level: Level, bark: Bark, leaf_rgba: NDArray[np.uint8] | None, card_rgba: NDArray[np.uint8] | None = None
) -> list[Drawable]:
    """Everything that a level shows; without leaves where `leaf_rgba` is None."""
    found = [wood_drawable(level.mesh, bark)]
    if leaf_rgba is not None:
        found += leaf_drawables(level.prototypes, level.leaves.prototype, leaf_matrices(level.leaves), leaf_rgba)
    if card_rgba is not None:
        found.append(_textured("leaf_cards", level.cards, card_rgba, is_leaf=True))
    return found


def wood_drawable(mesh: Mesh, bark: Bark) -> Drawable:
    """Wood in its bark."""
    return _textured("branches", mesh, bark_rgba(bark), is_leaf=False)


def bark_rgba(bark: Bark) -> NDArray[np.uint8]:
    """The bark as an opaque texture (H, W, 4)."""
    return np.dstack([bark.rgb, np.full(bark.rgb.shape[:2], 255, np.uint8)])


def leaf_drawables(
    prototypes: Sequence[LeafPrototype],
    prototype: NDArray[np.int64],
    places: NDArray[np.float64],
    rgba: NDArray[np.uint8],
) -> list[Drawable]:
    """Leaves by their prototypes (L,) and places (L, 4, 4), over one atlas (H, W, 4)."""
    return [
        _textured(f"leaf_{k}", leaf, rgba, is_leaf=True, transforms=places[prototype == k])
        for k, leaf in enumerate(prototypes)
    ]


def _textured(
    name: str,
    mesh: Mesh | LeafPrototype,
    rgba: NDArray[np.uint8],
    *,
    is_leaf: bool,
    transforms: NDArray[np.float64] | None = None,
) -> Drawable:
    return Drawable(
        name=name,
        points=mesh.points,
        faces=mesh.faces,
        uv=mesh.uv,
        normals=mesh.normals,
        texture=rgba,
        is_leaf=is_leaf,
        transforms=np.eye(4)[None] if transforms is None else transforms,
    )
