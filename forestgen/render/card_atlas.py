"""The cards' texture: every leaf and twig drawn onto its cards, all in one picture."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.render.card_cutout import bled
from forestgen.render.card_leaves import strip_drawables
from forestgen.render.card_mips import lasting_alpha
from forestgen.render.card_plan import CardPlan
from forestgen.render.drawable import Drawable
from forestgen.render.layout_kernels import placed
from forestgen.render.model_drawables import bark_rgba, leaf_drawables
from forestgen.render.raster import pictures
from forestgen.tree.lod_prototypes import simpler
from forestgen.tree.model import Bark, Mesh, TreeModel
from forestgen.tree.places import leaf_matrices

BLADE_TRIANGLES = 4  # of a leaf on a card, where it is a few texels long
FINER = 2  # px drawn a texel, both ways, each of four samples


def bake_cards(
    plan: CardPlan,
    model: TreeModel,
    leaf_rgba: NDArray[np.uint8] | None,
    *,
    alpha: NDArray[np.float32] | None = None,
) -> NDArray[np.uint8]:
    """The texture (side, side, 4), sRGB and straight alpha, of a tree's cards, its leaves over `leaf_rgba` (H, W, 4).

    Without leaves (winter) where `leaf_rgba` is None. Where alpha, interpolated, reaches one half, as much is
    covered as leaves and twigs do cover there (times the plan's shares); colour is bled under the edges. An `alpha`
    (side, side) in [0, 1] found before for the same leaves is taken as it is: finding it takes most of the time,
    and seasons change the colours only.

    Raises:
        ValueError: the plan is another tree's, or the atlas has another size than the tree's.
    """
    if len(plan.leaf_card) != len(model.leaves):
        raise ValueError(f"the cards show {len(plan.leaf_card)} leaves, but {model.name} has {len(model.leaves)}")
    drawables = [_twigs(plan, model.mesh, model.bark)] if len(plan.twig) else []
    if leaf_rgba is not None and len(model.leaves):
        drawables += _leaves(plan, model, leaf_rgba)
        drawables += strip_drawables(plan.strips, plan.strip_cell, plan.side, leaf_rgba)
    n = FINER if alpha is None else 1
    px = plan.side * n
    (finer,) = pictures(drawables, Camera((px, px), (0.0, float(px)), float(n)), [leaf_rgba])
    picture = np.asarray(cv2.resize(finer, (plan.side, plan.side), interpolation=cv2.INTER_AREA), np.float32)
    if alpha is not None:
        return bled(picture, alpha)
    coverage = np.where(plan.share > 0, picture[..., 3], np.float32(0))
    return bled(picture, lasting_alpha(coverage, coverage * plan.share))


def _leaves(plan: CardPlan, model: TreeModel, rgba: NDArray[np.uint8]) -> list[Drawable]:
    """The leaves on every card that shows them, in the texture's pixels."""
    places = plan.frame[plan.leaf_card] @ leaf_matrices(model.leaves)[:, None]
    prototype = np.repeat(model.leaves.prototype, plan.leaf_card.shape[1])
    blades = [simpler(blade, BLADE_TRIANGLES) for blade in model.atlas.prototypes]
    return leaf_drawables(blades, prototype, places.reshape(-1, 4, 4), rgba)


def _twigs(plan: CardPlan, mesh: Mesh, bark: Bark) -> Drawable:
    """The thin wood on every card that shows it, in the texture's pixels; only what faces the viewer."""
    corner, uv = mesh.points[mesh.faces[plan.twig]], mesh.uv[mesh.faces[plan.twig]]
    ahead = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    points, places = [], []
    for card in plan.twig_card.T:
        seen = np.einsum("ti,ti->t", plan.frame[card, 2, :3], ahead) > 0
        points.append(placed(corner[seen], plan.frame, card[seen]))
        places.append(uv[seen])
    flat = np.concatenate(points).reshape(-1, 3)
    return Drawable(
        name="twigs",
        points=flat,
        faces=np.arange(len(flat)).reshape(-1, 3),
        uv=np.concatenate(places).reshape(-1, 2),
        normals=np.broadcast_to([0.0, 0.0, 1.0], flat.shape),
        texture=bark_rgba(bark),
    )
