"""Wood: which pixels of a tree are branches. Every segmenter shares this rule."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.colour_model import Mixture
from forestgen.tree.segment.line_search import on_lines
from forestgen.tree.segment.lines import edge_directions
from forestgen.tree.segment.min_cut import min_cut
from forestgen.tree.segment.region import Region, bounding
from forestgen.tree.segment.ribbon import CLEAR, Ribbon, follow_limb, stations
from forestgen.tree.segment.smoothness import edge_costs
from forestgen.tree.segment.soft_edge import FLECK, soften, without_flecks
from forestgen.tree.segment.wood_colours import (
    ELSEWHERE,
    bark_colours,
    colours_under_strokes,
    distinct_colours,
    leaf_colours,
)
from forestgen.tree.strokes import Strokes

TRUNK_REACH, LIMB_REACH = 0.12, 0.06  # how far from its stroke a limb's edge is looked for, in crown sizes
UNDER_STROKE, UNDER_LEAVES = 1.0, 0.0  # log odds of wood: on a limb, on a hidden one
CLIP = 6.0  # nats that one pixel's colour can say at most
SMOOTH, GUARD = 4.0, 8.0  # as lambda and guard of the foliage cut: limbs are larger than leaves
BESIDE = -0.5  # log odds of wood between trunk and crown, off the strokes
LONG = 6.0  # area over squared half width from which a patch is a limb: a bar six half widths long has 12, a disc 3
STRAIGHT = 0.5  # how far a limb's edges run one way (1: parallel)
STRAIGHT_DETAIL = (1.5, 5.0)  # sigmas in px at which that is seen, of patches that are wider
FAINT = -50.0  # nats, for what is out of the question
SPECK = 3e-5  # of the crown's area: smaller patches of wood off the stroked limbs are shade between leaves


@dataclass(frozen=True, eq=False)
class Limbs:
    """The limbs under the branch strokes of a region (h, w)."""

    ribbons: tuple[Ribbon, ...]
    cover: NDArray[np.float32]  # (h, w) share of each pixel under any ribbon, nothing below the root
    is_clear: NDArray[np.bool_]  # (h, w) pixels under a ribbon whose edges can be seen there
    is_fork_zone: NDArray[np.bool_]  # (h, w) outside the crown, between trunk and crown: where limbs may run
    colours: Mixture | None  # of the wood; None where the strokes cover no pixel

    @property
    def is_near(self) -> NDArray[np.bool_]:
        """Pixels (h, w) under a ribbon or beside its edge."""
        return np.asarray(cv2.dilate(self.cover, np.ones((5, 5), np.uint8)) > 0)

    @property
    def is_limb(self) -> NDArray[np.bool_]:
        """Pixels (h, w) mostly under a ribbon."""
        return self.cover >= 0.5


def follow_limbs(region: Region, strokes: Strokes, *, rng: np.random.Generator) -> Limbs:
    """Find the edges of every stroked limb; the first stroke is the trunk and ends at the root's row."""
    size = (region.depth.shape[1], region.depth.shape[0])
    ribbons = []
    cover, clear = np.zeros((2, *region.depth.shape), np.float32)
    for index, path in enumerate(strokes.branches):
        reach = max(8.0, (LIMB_REACH if index else TRUNK_REACH) * region.size_px)
        bare = 0.0 if index else bare_share(region, path)
        ribbon = follow_limb(region.rgb, region.local(path), reach, bare)
        np.maximum(cover, ribbon.coverage(size), out=cover)
        np.maximum(clear, ribbon.coverage(size, ribbon.clarity > CLEAR / 2), out=clear)
        ribbons.append(ribbon)
    cover[max(int(np.ceil(region.local(strokes.root)[1])), 0) :] = 0
    is_clear = (clear >= 0.5) & (cover >= 0.5)
    return Limbs(tuple(ribbons), cover, is_clear, fork_zone(region, strokes), colours_under_strokes(region, cover, rng))


def bare_share(region: Region, path: NDArray[np.float64]) -> float:
    """Share of a stroke (K, 2) px of the photo before it enters the crown; 1 where it never does."""
    along, _ = stations(region.local(path), 1.0, smooth=1.0)
    at = np.clip(np.floor(along).astype(int), 0, np.array(region.depth.shape[::-1]) - 1)
    in_crown = region.depth[at[:, 1], at[:, 0]] > 0
    return float(np.argmax(in_crown) / len(along)) if in_crown.any() else 1.0


def fork_zone(region: Region, strokes: Strokes) -> NDArray[np.bool_]:
    """Pixels (h, w) outside the crown but inside the hull of the crown and the upper half of the bare trunk."""
    h, w = region.depth.shape
    trunk = region.local(strokes.branches[0])
    at = np.clip(np.floor(trunk).astype(int), 0, [w - 1, h - 1])
    bare = trunk[region.depth[at[:, 1], at[:, 0]] < 0]
    upper = bare[bare[:, 1] < np.median(trunk[:, 1]) if not len(bare) else bare[:, 1] <= bare[:, 1].mean()]
    limbs = [region.local(path) for path in strokes.branches[1:]]
    corners = np.concatenate([region.local(strokes.crown), upper, *limbs])
    hull = cv2.convexHull(np.round(corners).astype(np.int32))
    zone = cv2.fillConvexPoly(np.zeros((h, w), np.uint8), hull, 1) > 0
    return np.asarray(zone & ~region.is_inside)


def find_wood(
    region: Region,
    is_tree: NDArray[np.bool_],
    log_background: NDArray[np.float32],
    limbs: Limbs,
    *,
    as_drawn: bool = False,
    rng: np.random.Generator,
) -> NDArray[np.bool_]:
    """Wood pixels (h, w): outside the crown the ribbons and what grows from them, inside what has the wood's colours.

    `is_tree` says what is leaf or wood inside the crown, `log_background` (h, w) how likely each
    colour is as background. Wood may also be found where `is_tree` missed it. `as_drawn`, all that
    lies under the strokes is a sample of wood, the leaves that hide it too (Tan et al. 2008, sec. 2).
    """
    if limbs.colours is None:
        return np.zeros_like(is_tree)
    inside, beside = region.is_inside, limbs.is_fork_zone
    says = np.full(inside.shape, -CLIP, np.float32)
    says[beside] = limbs.colours.log_density(region.rgb[beside]) - log_background[beside] + BESIDE
    leaf = leaf_colours(region, is_tree, limbs.cover, limbs.colours, rng)
    bark = limbs.colours if as_drawn else bark_colours(region, is_tree, limbs.cover, limbs.colours, rng)
    wood = distinct_colours(limbs.colours, leaf)
    rgb, on_limb = region.rgb[inside], limbs.is_limb[inside]
    other = log_background[inside] if leaf is None else np.logaddexp(leaf.log_density(rgb), log_background[inside])
    like_bark = bark.log_density(rgb)
    off_limb = np.full(len(rgb), FAINT, np.float32) if wood is None else wood.log_density(rgb)
    place = np.where(limbs.is_clear[inside], UNDER_STROKE, np.where(on_limb, UNDER_LEAVES, ELSEWHERE))
    says[inside] = np.where(on_limb, like_bark, off_limb) - other + place
    ribbon = limbs.is_limb & ~inside
    says[ribbon] = CLIP
    window = bounding(inside | beside | ribbon)
    votes = np.clip(says[window], -CLIP, CLIP)
    found = np.zeros_like(inside)
    found[window] = min_cut(np.maximum(-votes, 0), np.maximum(votes, 0), *edge_costs(region.rgb[window], SMOOTH, GUARD))
    on_line = np.full(inside.shape, -CLIP, np.float32)
    on_line[inside] = np.where(on_limb, like_bark, limbs.colours.log_density(rgb)) - other
    lines = on_lines(on_line, is_tree, region.size_px)
    return ribbon | _like_limbs(found & inside, region, limbs) | lines | _forks(found & beside, ribbon, is_tree)


def _like_limbs(found: NDArray[np.bool_], region: Region, limbs: Limbs) -> NDArray[np.bool_]:
    """The wood (h, w) on stroked limbs, and of the patches off them those that look like limbs.

    A limb is longer than wide and its two edges run one way; shade between leaves comes in specks and blobs.
    """
    label, area, radius = _patches(found & ~limbs.is_limb)
    keep = (area > LONG * radius**2) & (area >= max(4, SPECK * region.size_px**2))
    for detail in STRAIGHT_DETAIL:
        edges = edge_directions(found, detail)
        strength, directed = (np.bincount(label.ravel(), value.ravel(), len(area)) for value in edges)
        keep &= (directed > STRAIGHT * strength) | (radius < detail)
    keep[0] = False
    return np.asarray(keep[label] | (found & limbs.is_limb))


def _forks(found: NDArray[np.bool_], ribbon: NDArray[np.bool_], is_tree: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The patches of wood (h, w) below the crown that lead from a stroked limb up into the crown."""
    _, label = cv2.connectedComponents((found & ~ribbon).astype(np.uint8), connectivity=8)
    block = np.ones((5, 5), np.uint8)
    from_limb, to_crown = (np.unique(label[cv2.dilate(end.astype(np.uint8), block) > 0]) for end in (ribbon, is_tree))
    both = np.intersect1d(from_limb, to_crown)
    return np.asarray(np.isin(label, both[both > 0]))


def _patches(mask: NDArray[np.bool_]) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]:
    """Labels (h, w) of a mask's connected patches, and of each its area and half width, pores closed."""
    _, label, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    solid = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    depth = cv2.distanceTransform(solid, cv2.DIST_L2, 3)
    patch = np.asarray(label, np.int32)
    area = np.asarray(stats[:, cv2.CC_STAT_AREA], np.int32)
    radius = (
        2 * np.bincount(patch.ravel(), depth.ravel(), len(area)) / np.maximum(area, 1)
    )  # of a bar, the mean is half
    return patch, area, radius


def matte(
    region: Region, is_leaf: NDArray[np.bool_], is_wood: NDArray[np.bool_], limbs: Limbs
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Alpha of leaf and of wood (h, w), soft at the tree's edge; below the crown the ribbons' own edges."""
    alpha = without_flecks(soften(region.rgb, is_leaf | is_wood), FLECK * region.size_px**2)
    by_ribbon = limbs.is_near & ~region.is_inside & (limbs.is_limb | ~is_wood)
    alpha = np.where(by_ribbon, limbs.cover, alpha)
    return share_out(alpha, is_leaf, is_wood)


def share_out(
    alpha: NDArray[np.float32], is_leaf: NDArray[np.bool_], is_wood: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Split the tree's alpha (h, w) into leaf and wood; the soft rim goes to what it is the rim of.

    A pixel belongs to one of them: split evenly, both would fall below one half and leave a seam.
    """
    near_leaf, near_wood = (cv2.blur(mask.astype(np.float32), (5, 5)) for mask in (is_leaf, is_wood))
    to_wood = is_wood | (~is_leaf & (near_wood > near_leaf))
    return np.where(to_wood, 0, alpha).astype(np.float32), np.where(to_wood, alpha, 0).astype(np.float32)
