"""CardPlan: where a tree's cards stand, where each lies in their texture, and what each of them shows.

A billboard cloud (Decoret et al. 2003, "Billboard clouds for extreme model simplification") of three families of
parallel cards: across z, across x, and level. Each leaf and each piece of thin wood is shown by the nearest card
of every family, as seen straight onto it. From the front, the side and above the picture is exact whatever the
cards' distance; from in between a leaf is seen on two or three cards at once, each at most half a distance off.
So the leaves and twigs that draw the outlines stay solid, and cards are cut off where they reach beyond them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.camera import Camera
from forestgen.render.card_layout import groups
from forestgen.render.card_leaves import FINER, LEAST, LeafStrips, leaf_strips, strip_pieces
from forestgen.render.card_mesh import card_pieces, outward_mesh
from forestgen.render.card_outline import Outlines
from forestgen.render.card_solid import solid_things, twig_wedges
from forestgen.render.card_wood import coarse_wood, thick_skeleton, thin_faces
from forestgen.render.layout_kernels import box_around, boxes
from forestgen.tree.joined import joined
from forestgen.tree.level import NO_LEAVES, Level
from forestgen.tree.model import Mesh, TreeModel
from forestgen.tree.places import leaf_matrices

SIDE = 1024  # px of the card texture, both ways
GUTTER = 4  # px between cells: two mip levels stay apart
SWITCH_PX = 60.0  # at which cards and the full tree look alike
N_SLABS = 90  # over all families
N_BARE_SLABS = 45  # of a bare tree: twigs inside it want texels more than depth, and its outline is solid
N_CARDS = 180  # two triangles each
BEYOND = 0.2  # texels that a card may reach beyond the tree's outline
RIM = 0.015  # of the height: how deep below an outline its rim goes
RIM_SHARE = 1.4  # of the coverage there: the gaps between what the outline hangs on stay as narrow as they were
LEVEL_SHARE = 0.8  # of the coverage on level cards: seen aslant they come on top of the upright ones'
UPRIGHT_SHARE = 0.97  # likewise where two upright families are seen together
FAMILIES = tuple(Camera((1, 1), (0.0, 0.0), 1.0, *angles).axes for angles in ((0, 0), (np.pi / 2, 0), (0, np.pi / 2)))
SHARES = (UPRIGHT_SHARE, UPRIGHT_SHARE, LEVEL_SHARE)


@dataclass(frozen=True, eq=False)
class CardPlan:
    """C cards, K = 3 families, L leaves and T faces of thin wood of one tree."""

    mesh: Mesh  # the cards, four points and two faces each, and the leaves that stay solid, over the card texture
    wood: Mesh  # trunk and main limbs as coarse tubes, and the ends of twigs that stay solid
    side: int  # px, width and height of the texture
    px_per_metre: float  # of the cells
    frame: NDArray[np.float64]  # (C, 4, 4) tree to texture: px right, px up from its lower edge, px before the card
    cell: NDArray[np.int64]  # (C, 4) px: left, top, width, height
    share: NDArray[np.float32]  # (S, S) S = side: of the coverage that a texel is to show; 0 beyond the tree's outline
    strips: LeafStrips  # leaves that stay solid; their cells (B, 4) px
    strip_cell: NDArray[np.int64]
    leaf_card: NDArray[np.int64]  # (L, K) the cards that show a leaf
    twig: NDArray[np.int64]  # (T,) faces of the tree's mesh that are on cards
    twig_card: NDArray[np.int64]  # (T, K)

    def __post_init__(self) -> None:
        freeze(
            self,
            frame=(np.float64, "C", 4, 4),
            cell=(np.int64, "C", 4),
            share=(np.float32, "S", "S"),
            strip_cell=(np.int64, "B", 4),
            leaf_card=(np.int64, "L", "K"),
            twig=(np.int64, "T"),
            twig_card=(np.int64, "T", "K"),
        )

    def level(self, model: TreeModel) -> Level:
        """The cards as the last level of detail of the tree that they were planned for.

        Raises:
            ValueError: the plan is another tree's.
        """
        if len(self.leaf_card) != len(model.leaves):
            raise ValueError(f"the cards show {len(self.leaf_card)} leaves, but {model.name} has {len(model.leaves)}")
        return Level(self.wood, NO_LEAVES, (), self.mesh, SWITCH_PX)


def plan_cards(model: TreeModel, *, n_slabs: int | None = None, n_cards: int = N_CARDS, side: int = SIDE) -> CardPlan:
    """Lay out at most about `n_cards` cards for a tree over a texture of `side` px."""
    if n_slabs is None:
        n_slabs = N_SLABS if len(model.leaves) else N_BARE_SLABS
    thick = thick_skeleton(model)
    twig = thin_faces(model, thick)
    low, high = _boxes(model, twig)
    cards = groups(low, high, n_slabs, n_cards, GUTTER + 1.0, side)
    family = np.array([card.family for card in cards], np.int64)
    shown_by = np.zeros((len(low), len(FAMILIES)), np.int64)
    box = np.zeros((len(cards), 2, 3))
    for c, card in enumerate(cards):
        shown_by[card.member, card.family] = c
        near, far = low[card.member, card.family], high[card.member, card.family]
        box[c] = box_around(low, high, card.member, card.family)
        weight = (far - near)[:, :2].prod(axis=1) + 1e-12
        box[c, :, 2] = np.average((near + far)[:, 2] / 2, weights=weight)
    solid = solid_things(model)
    strips = leaf_strips(model, solid.leaf)
    sizes = np.concatenate([np.ptp(box[:, :, :2], axis=1), FINER * strips.size])
    scale, cell = _packed(sizes, side, np.repeat([1, LEAST], [len(box), len(strips.size)]))
    cell, strip_cell = cell[: len(box)], cell[len(box) :]
    axes = np.array(FAMILIES)[family]
    frame = _frames(box, axes, cell, scale, side)
    return CardPlan(
        mesh=outward_mesh(card_pieces(box, axes, cell, scale, side), strip_pieces(strips, strip_cell, side)),
        wood=joined([coarse_wood(model, thick), twig_wedges(solid, model.bark)]),
        side=side,
        px_per_metre=scale,
        frame=frame,
        cell=cell,
        share=_shares(np.array(SHARES)[family], solid.outlines, frame, cell, scale, side, RIM * model.height),
        strips=strips,
        strip_cell=strip_cell,
        leaf_card=shown_by[: len(model.leaves)],
        twig=twig,
        twig_card=shown_by[len(model.leaves) :],
    )


def _boxes(model: TreeModel, twig: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and greatest coordinates (L + T, K, 3) of leaves and faces of thin wood along the families' axes."""
    axes = np.array(FAMILIES)
    n = len(model.leaves)
    low, high = (np.empty((n + len(twig), len(FAMILIES), 3)) for _ in range(2))
    places = leaf_matrices(model.leaves)
    for k, prototype in enumerate(model.atlas.prototypes):
        mine = np.flatnonzero(model.leaves.prototype == k)
        turned = np.einsum("kai,lij->lkaj", axes, places[mine, :3, :3])
        middle = np.einsum("kai,li->lka", axes, places[mine, :3, 3])
        reach = turned @ prototype.points.T  # (l, K, 3, V)
        low[mine], high[mine] = middle + reach.min(axis=3), middle + reach.max(axis=3)
    boxes(model.mesh.points, model.mesh.faces[twig], axes, low[n:], high[n:])
    return low, high


def _packed(sizes: NDArray[np.float64], side: int, least: NDArray[np.int64]) -> tuple[float, NDArray[np.int64]]:
    """The greatest scale (px a metre), within 1 %, at which rectangles (C, 2) m fit, and their cells (C, 4) px.

    None is less than `least` (C,) px wide or high.
    """
    if not len(sizes):
        return 1.0, np.zeros((0, 4), np.int64)
    scale = float(np.sqrt(side * side / max(sizes.prod(axis=1).sum(), 1e-12)))
    scale = min(scale, (side - 2 * GUTTER) / float(sizes.max()))
    while True:
        px = np.maximum(np.ceil(sizes * scale).astype(np.int64), least[:, None])
        cell, height = _shelves(px, side)
        if height <= side:
            return scale, cell
        scale *= 0.99


def _shelves(px: NDArray[np.int64], side: int) -> tuple[NDArray[np.int64], int]:
    """Cells (C, 4) of rectangles (C, 2) px laid on shelves, tallest first, and the height that they take."""
    cell = np.zeros((len(px), 4), np.int64)
    left = top = shelf = GUTTER // 2
    shelf = 0
    for k in np.lexsort((np.arange(len(px)), -px[:, 0], -px[:, 1])):
        width, height = int(px[k, 0]), int(px[k, 1])
        if left + width + GUTTER // 2 > side:
            left, top, shelf = GUTTER // 2, top + shelf + GUTTER, 0
        cell[k] = left, top, width, height
        left, shelf = left + width + GUTTER, max(shelf, height)
    return cell, top + shelf + GUTTER // 2


def _frames(
    box: NDArray[np.float64], axes: NDArray[np.float64], cell: NDArray[np.int64], scale: float, side: int
) -> NDArray[np.float64]:
    """From the tree's metres to the texture (C, 4, 4): the box's middle falls on its cell's, the card on depth 0."""
    frame = np.zeros((len(box), 4, 4))
    frame[:, :3, :3] = axes * scale
    middle = np.column_stack([cell[:, 0] + cell[:, 2] / 2, side - cell[:, 1] - cell[:, 3] / 2, np.zeros(len(cell))])
    frame[:, :3, 3] = middle - box.mean(axis=1) * scale
    frame[:, 3, 3] = 1
    return frame


def _shares(
    share: NDArray[np.float64],
    outlines: Outlines,
    frame: NDArray[np.float64],
    cell: NDArray[np.int64],
    scale: float,
    side: int,
    rim: float,
) -> NDArray[np.float32]:
    """How much of their coverage the cards' texels (side, side) are to show, by the shares (C,) of their cards.

    More within `rim` metres of an outline, none further beyond one than BEYOND texels, or half a cell of it.
    """
    most = max(BEYOND / scale, 0.5 / outlines.cells_per_metre)
    found = np.ones((side, side), np.float32)
    for part, place, (left, top, width, height) in zip(share.tolist(), frame, cell.tolist(), strict=True):
        texel = np.array([[left, top], [left + 1, top], [left, top + 1]]) + 0.5
        flat = np.column_stack([texel[:, 0], side - texel[:, 1], np.zeros(3)])
        corner = (flat - place[:3, 3]) @ np.linalg.inv(place[:3, :3]).T
        away = outlines.farthest_beyond(corner, (width, height))
        mine = np.where(away > -rim, part * RIM_SHARE, part)
        found[top : top + height, left : left + width] = np.where(away > most, 0, mine)
    return found
