"""Bark stage: a texture that tiles, made of the trunk's own pixels, or their plain colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.model import Bark
from forestgen.tree.painted import painted_over
from forestgen.tree.quilting import blur_torus, enlarge, quilt, valid_places
from forestgen.tree.strategy import Strategy
from forestgen.tree.strokes import draw_polyline
from forestgen.tree.trunk_strip import TrunkStrip, bark_colour, evenly_lit, trunk_strip
from forestgen.tree.view import View

PLAIN_SIZE = 1.0  # metres that one repeat of a plain colour covers: any would do
FEWEST = 6  # squares of the smallest width that must show bark


@dataclass(frozen=True, kw_only=True)
class BarkFromPhoto(Strategy):
    """A tile quilted from the trunk that the photo shows (Efros & Freeman 2001 for the quilting).

    Tan et al. 2008 do not say where their bark comes from, so all defaults are ours.
    """

    width_px: int = 256  # of the tile, which covers the trunk half way round: no side shows it twice
    tallness: float = 2.0  # height of the tile over its width
    half_angle_deg: float = 56.0  # how far from the front the trunk's pixels are taken; beyond they are squeezed
    patch: float = 0.55  # size of a patch, as a share of the strip's width
    smallest_px: int = 10  # a trunk that shows fewer pixels across than that gives a plain colour
    evenness: float = 0.22  # light and shade larger than this share of the strip's width are taken out
    detail: float = 0.5  # strength of each octave of detail finer than the photo's
    limbs: float = 0.6  # weight of all the wood's colour beside the trunk's, on a bare tree: it is mostly limbs

    def __call__(self, views: Sequence[View], *, rng: np.random.Generator) -> Bark:
        """The bark of the tree, from the view that shows most of it, in the mean colour of all of them."""
        strips = [trunk_strip(view, np.deg2rad(self.half_angle_deg), self.width_px) for view in views]
        best = max(range(len(views)), key=lambda k: float(strips[k].is_bark.sum()))
        strip = strips[best]
        patch = largest_patch(strip, round(self.patch * strip.rgb.shape[1]), self.smallest_px // 2)
        if min(strip.rgb.shape[:2]) < self.smallest_px or not patch:
            return plain_bark(views[best])
        even = evenly_lit(strip, self.evenness)
        overlap = max(2, patch // 3)
        columns = max(2, round(np.pi * strip.radius / (patch - overlap)))
        rows = max(2, round(self.tallness * columns))
        tile = quilt(even.rgb, even.is_bark, (rows, columns), patch, overlap, rng=rng)
        shown = [(view, one) for view, one in zip(views, strips, strict=True) if one.is_bark.any()]
        colour = np.asarray(np.mean([self.colour(view, one) for view, one in shown], axis=0), np.float32)
        height = 64 * max(1, round(self.width_px * rows / columns / 64))
        large = enlarge(balanced(tile, colour), (height, self.width_px), self.detail)
        return Bark(
            np.round(np.clip(large, 0, 1) * 255).astype(np.uint8),
            width_m=tile.shape[1] / strip.px_per_metre,
            height_m=tile.shape[0] / strip.px_per_metre,
        )

    def colour(self, view: View, strip: TrunkStrip) -> NDArray[np.float32]:
        """Mean sRGB (3,) of the bark in one view, which has its own light."""
        trunk = bark_colour(strip)
        leaves = view.mattes.is_foliage & ~painted_over(view.strokes.density, view.mattes.foliage.shape)
        return trunk if leaves.any() else trunk + np.float32(self.limbs) * (wood_colour(view) - trunk)


def wood_colour(view: View) -> NDArray[np.float32]:
    """Mean sRGB (3,) in [0, 1] of all the wood that a photo shows."""
    return np.asarray(view.photo.rgb[view.mattes.is_branch].mean(axis=0) / 255, np.float32)


def largest_patch(strip: TrunkStrip, wanted: int, smallest: int) -> int:
    """The largest patch up to `wanted` px that fits into the strip's bark in enough places, 0 if none."""
    size: int = min(wanted, *strip.is_bark.shape)
    while size >= max(smallest, 4):
        if len(valid_places(strip.is_bark, size)) >= FEWEST:
            return size
        size = int(size * 0.8)
    return 0


def balanced(tile: NDArray[np.float32], colour: NDArray[np.float32]) -> NDArray[np.float32]:
    """The tile (H, W, 3) without its largest blotches, which would show as a grid, with mean `colour` (3,)."""
    blotch = blur_torus(tile, tile.shape[1] / 8)
    even = tile * (blotch.mean(axis=(0, 1)) / np.maximum(blotch, 1e-3)) ** 0.7
    return np.asarray(even * (colour / np.maximum(even.mean(axis=(0, 1)), 1e-3)), np.float32)


def plain_bark(view: View) -> Bark:
    """One pixel of the trunk's median colour.

    Of the wood under the trunk stroke; of all wood where the matte has none there; of the stroke
    itself where the matte has no wood at all.
    """
    stroke = draw_polyline(view.strokes.branches[0], view.photo.size, 5)
    wood = view.mattes.is_branch & ~view.mattes.is_foliage
    source = next((mask for mask in (wood & stroke, wood, stroke) if mask.sum() >= 4), stroke | True)
    colour = np.asarray(np.median(view.photo.rgb[source], axis=0))
    return Bark(np.round(colour).astype(np.uint8).reshape(1, 1, 3), PLAIN_SIZE, PLAIN_SIZE)
