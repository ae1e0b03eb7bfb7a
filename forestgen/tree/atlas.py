"""The leaf atlas: leaves cut from the photo's own foliage, and the prototypes that wear them."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.atlas_packing import compose, pack
from forestgen.tree.common_light import in_common_light
from forestgen.tree.leaf_blades import LONG_STALK, PETIOLE, Blade, build_blade, trim
from forestgen.tree.leaf_cells import Pieces, find_pieces, group_colours, rank_pieces
from forestgen.tree.leaf_drawing import cut_cell, generic_cell
from forestgen.tree.leaf_scale import bears_needles, height_px, leaf_length_px
from forestgen.tree.leaf_shapes import Form
from forestgen.tree.model import Atlas, LeafPrototype
from forestgen.tree.strategy import Strategy
from forestgen.tree.view import View

log = logging.getLogger(__name__)

TRIES = 16  # pieces tried for each colour before a leaf is drawn instead


@dataclass(frozen=True, kw_only=True)
class LeafAtlasFromPhoto(Strategy):
    """Cells cut from the photo, chosen to span the crown's colours and lights.

    Tan et al. 2008, sec. 4 texture each leaf by its projected place in the photo; readers lose
    colours on instances, so here a leaf takes the prototype whose colour fits that place.
    """

    colours: int = 32  # ours: cells cut, as many different colours; two neighbours differ by some 4 CIELAB
    long_stalked: bool = True  # ours: each cell worn twice, by a leaf and by one that reaches farther from its twig
    cell_px: int = 112  # ours: length of a leaf in the atlas, petiole included
    piece_share: float = 0.02  # ours: a cut piece is at least this share of the tree's height long
    piece_lengths: float = 1.5  # ours: and this many times the length of a leaf in the photo
    needles: Literal["measured", "always", "never"] = "measured"  # ours: sprays of needles instead of leaves
    coarse_px: float = 13.0  # ours: pieces shorter than this are too coarse to cut; generic outlines take their colours

    def __post_init__(self) -> None:
        if not 1 <= self.colours <= 128:
            raise ValueError(f"colours is {self.colours}; expected 1 to 128")
        if not 32 <= self.cell_px <= 160:
            raise ValueError(f"cell_px is {self.cell_px}; expected 32 to 160")

    def __call__(self, views: Sequence[View], *, rng: np.random.Generator) -> Atlas:
        leafy = [view for view in views if not view.mattes.is_bare]
        if not leafy:
            return Atlas(np.zeros((1, 1, 4), np.uint8), ())
        cells, lengths = [], []
        for k, (view, pure) in enumerate(zip(leafy, in_common_light(leafy), strict=True)):
            length = max(self.piece_share * height_px(view), self.piece_lengths * leaf_length_px(view))
            pieces = find_pieces(view, pure, length)
            n = self.colours * (k + 1) // len(leafy) - self.colours * k // len(leafy)
            form, used = self.form(view, length), set[int]()
            for lab, near in rank_colours(pieces, max(1, n)):
                fresh = [piece for piece in near if piece not in used] or near
                cell, piece = self.draw(pieces, lab, fresh, form, rng=rng)
                used.add(piece)
                cells.append(cell)
                lengths.append(float(pieces.length[piece]) / (1 - PETIOLE))
        outlines = [trim(cell[..., 3] / 255) for cell in cells]
        size, corner = pack([(cell.shape[1], cell.shape[0]) for cell in cells])
        rgba = compose(cells, size, corner)
        leaves = [
            prototype(cell, build_blade(outline, len(cell), stalk, rng=rng), at, size, length)
            for stalk in ((PETIOLE, LONG_STALK) if self.long_stalked else (PETIOLE,))
            for cell, outline, at, length in zip(cells, outlines, corner, lengths, strict=True)
        ]
        log.info("atlas: %d prototypes, %d x %d px", len(leaves), *size)
        return Atlas(rgba, tuple(leaves))

    def form(self, view: View, piece_px: float) -> Form | None:
        """Which outline to draw where none can be cut; None where leaves can be cut from the photo."""
        if self.needles == "always" or (self.needles == "measured" and bears_needles(view)):
            return "needles"
        return "ovate" if piece_px < self.coarse_px else None

    def draw(
        self,
        pieces: Pieces,
        lab: NDArray[np.float64],
        near: Sequence[int],
        form: Form | None,
        *,
        rng: np.random.Generator,
    ) -> tuple[NDArray[np.uint8], int]:
        """The cell of a colour (3,) CIELAB and the piece that it is from: the best of the pieces near it that
        can be cut, else a drawn leaf in the colours of the first."""
        for piece in near if form is None else []:
            cell = cut_cell(pieces, piece, lab, self.cell_px)
            if cell is not None:
                return cell, piece
        return generic_cell(pieces, near[0], lab, self.cell_px, form or "ovate", rng=rng), near[0]


def rank_colours(pieces: Pieces, n: int) -> Iterator[tuple[NDArray[np.float64], list[int]]]:
    """At most n colours (3,) CIELAB that span the crown, each with the most leaf-like pieces near it."""
    colour = group_colours(pieces, n)
    yield from zip(colour, rank_pieces(pieces, colour, TRIES).tolist(), strict=True)


def prototype(
    cell: NDArray[np.uint8], blade: Blade, corner: NDArray[np.int64], size: tuple[int, int], length_px: float
) -> LeafPrototype:
    """A leaf that wears the cell (h, w, 4) at `corner` (left, top) px of a texture of `size` (width, height)."""
    height, width = cell.shape[:2]
    across = corner[0] + width / 2 + blade.flat[:, 0] * height
    down = corner[1] + (1 - blade.flat[:, 1]) * height
    uv = np.column_stack([across / size[0], 1 - down / size[1]])
    counts = cell[..., 3] >= 128
    colour = cell[counts][:, :3].mean(axis=0) / 255
    return LeafPrototype(blade.points, blade.normals, uv, blade.faces, colour, length_px)
