"""Mattes by way of a trimap: what colours say, then an alpha matte where they leave doubt, then leaf and wood apart."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from forestgen.errors import StageError
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.segment.bare import is_bare_crown
from forestgen.tree.segment.contrast import contrast_inside_and_ring
from forestgen.tree.segment.neighbours import without_neighbours
from forestgen.tree.segment.open_sky import without_sky
from forestgen.tree.segment.region import Region, look_at
from forestgen.tree.segment.soft_edge import FLECK, soften, without_flecks
from forestgen.tree.segment.trimap import trimap_of
from forestgen.tree.segment.wood import Limbs, find_wood, follow_limbs, share_out
from forestgen.tree.segment.working_size import enlarge, shrink
from forestgen.tree.strokes import Strokes

Alpha = NDArray[np.float32]
Trimap = NDArray[np.float64]
Solve = Callable[[NDArray[np.float32], Trimap, Alpha], NDArray[np.floating]]
"""From a picture (h, w, 3), its trimap and the share of tree colour nearby, both (h, w), to alpha (h, w)."""


def matted(
    photo: Photo,
    strokes: Strokes,
    solve: Solve,
    *,
    components: int,
    dilations: int,
    band: int,
    bare: Literal["auto", "yes", "no"],
    open_sky: bool,
    rng: np.random.Generator,
) -> Mattes:
    """Both mattes of the tree.

    Raises:
        StageError: neither leaf nor branch pixels are found, or there is no background to compare with.
    """
    working, drawn = shrink(photo, strokes)
    region = look_at(working.rgb, drawn, dilations)
    limbs = follow_limbs(region, drawn, rng=rng)
    evidence = contrast_inside_and_ring(region, components, rng=rng)
    is_tree = (evidence.log_ratio > 0) & region.is_inside & ~region.is_ring
    if bare == "yes" or (bare == "auto" and is_bare_crown(region, is_tree, limbs.cover)):
        is_wood = is_tree | limbs.is_limb
    else:
        is_wood = find_wood(region, is_tree, evidence.log_background, limbs, rng=rng)
        is_tree, is_wood = without_neighbours(region, is_tree, is_wood, limbs)
    if not (is_tree | is_wood).any():
        raise _nothing(photo)
    alpha = tree_alpha(region, is_tree | is_wood, is_wood, limbs, band, solve)
    leaf, wood = share_out(alpha, is_tree & ~is_wood, is_wood)
    if open_sky:
        leaf = without_sky(region, leaf, wood)
    mattes = enlarge(Mattes(region.full(leaf, working.size), region.full(wood, working.size)), photo.size)
    if not mattes.is_tree.any():
        raise _nothing(photo)
    return mattes


def tree_alpha(
    region: Region, is_tree: NDArray[np.bool_], is_wood: NDArray[np.bool_], limbs: Limbs, band: int, solve: Solve
) -> Alpha:
    """Alpha (h, w) of the tree; below the crown the limbs' own edges."""
    trimap = trimap_of(is_tree, band, sure_tree=limbs.is_clear, sure_background=region.is_ring & ~is_wood)
    alpha = solve(region.rgb, trimap, soften(region.rgb, is_tree))
    alpha = without_flecks(alpha.astype(np.float32), FLECK * region.size_px**2)
    by_limb = limbs.is_near & ~region.is_inside & (limbs.is_limb | ~is_wood)
    return np.where(by_limb, limbs.cover, alpha)


def _nothing(photo: Photo) -> StageError:
    return StageError(f"{photo.name}: the crown shows neither leaf nor branch: is the outline on the tree?")
