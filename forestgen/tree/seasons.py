"""Seasons of a tree: the leaf atlas recoloured, and which leaves have fallen.

`photo` is the tree as photographed. Summer and autumn are made from it where there is foliage: an atlas that
already shows a season keeps it. Winter is bare wood, or for an evergreen the same leaves, darker and bluer.
What a bare photo does not show cannot be invented: such a tree has `photo` and `winter` only (`seasons_of`).
"""

from __future__ import annotations

from typing import Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.atlas_cells import Cells, find_cells
from forestgen.tree.atlas_packing import SOLID, bleed
from forestgen.tree.leaf_colours import lab_of
from forestgen.tree.model import Atlas, Leaves, TreeModel
from forestgen.tree.season_colours import IS_GREEN, IS_NEITHER, IS_TURNED, classify, reflectance, repaint
from forestgen.tree.srgb import bytes_from_linear, linear_from_bytes

Season = Literal["photo", "summer", "autumn", "winter"]
SEASONS: tuple[Season, ...] = get_args(Season)

GREEN_LEFT = 0.14  # share of an autumn crown's cells that have not turned yet
FALLEN = 0.25  # share of the leaves on the ground in autumn
BY_LIGHT = 0.45  # how far light decides which cells turn first: sunlit leaves do, those in the shade stay green
MOODS = (0.8, 1.7)  # trees lie between russet and yellow autumns: the exponent on how far their leaves turn
MARGIN, MOTTLE = 0.16, 0.07  # a leaf's margin turns before its veins; and it turns in patches
MOTTLE_PX = 7.0  # sigma of such a patch
GREENS = 0.07  # how far summer's greens differ, on the way to yellow
WINTER_LIGHT = np.array([0.74, 0.79, 0.86], np.float32)  # an evergreen's linear light in winter over that in summer


def seasons_of(model: TreeModel) -> tuple[Season, ...]:
    """The seasons that a tree can show."""
    return SEASONS if len(model.leaves) else ("photo", "winter")


def season_atlas(
    atlas: Atlas, season: Season, *, evergreen: bool = False, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """The atlas's texture (H, W, 4) in a season: same matte, other colours, bled under the edge as before.

    Summer turns what is not green green, autumn what is green or blossom; what has the season's colours
    stays. Winter changes an evergreen only: others have no leaves then.

    Raises:
        ValueError: the atlas holds no leaf and the season is summer or autumn, or there is no such season.
    """
    if season not in SEASONS:
        raise ValueError(f"{season!r} is no season; expected one of {', '.join(SEASONS)}")
    if season == "photo" or (season == "winter") != evergreen:
        return atlas.rgba
    if not atlas.prototypes:
        raise ValueError(f"a bare tree has no leaves for {season}")
    cells = find_cells(atlas)
    rgb = atlas.rgba[cells.row, cells.column, :3]
    if evergreen:
        new = bytes_from_linear(linear_from_bytes(rgb) * WINTER_LIGHT)
    else:
        new = _turn(atlas, cells, rgb, season, rng)
    out = atlas.rgba.copy()
    out[cells.row, cells.column, :3] = new
    return bleed(out)


def _turn(
    atlas: Atlas, cells: Cells, rgb: NDArray[np.uint8], season: Season, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """The solid texels' colours (N, 3) in summer or autumn."""
    lab = cells.mean(lab_of(rgb))
    kind = classify(lab)
    share = np.bincount(kind, minlength=3)
    crown = IS_NEITHER if 2 * share[IS_NEITHER] > cells.n else int(share[IS_TURNED] > share[IS_GREEN])
    wanted = IS_GREEN if season == "summer" else IS_TURNED
    stays = (kind == wanted) & (crown != IS_NEITHER) | ((crown == wanted) & (kind == IS_NEITHER))
    stays |= season == "autumn" and crown == IS_TURNED  # what is green in an autumn photo is green in autumn
    turned = (_summer if season == "summer" else _autumn)(lab[:, 0], rng)
    stays |= (season == "autumn") & (turned == 0) & (kind == IS_GREEN)
    changes = ~stays[cells.of]
    out = rgb.copy()
    if changes.any():
        uneven = _mottle(atlas, cells, rng) * np.where(turned > GREENS, 1.0, GREENS)[cells.of]
        colourful = float(np.median(np.hypot(lab[:, 1], lab[:, 2]) / (lab[:, 0] + 1)))
        was = reflectance(lab[~stays].mean(axis=0))
        out[changes] = repaint(rgb[changes], turned[cells.of][changes], uneven[changes], was, colourful)
    return out


def _summer(light: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """How far cells (K,) are on the way from deep green: hardly."""
    return rng.uniform(0, GREENS, len(light))


def _autumn(light: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """How far cells (K,) of mean lightness (K,) have turned; 0 is green still.

    Each share of the way is taken by as many cells; which ones is chance and light.
    """
    n = len(light)
    mood = float(np.exp(rng.uniform(*np.log(MOODS))))
    rank = np.argsort(np.argsort(light, kind="stable"), kind="stable") / max(n - 1, 1)
    order = np.argsort(BY_LIGHT * rank + (1 - BY_LIGHT) * rng.uniform(size=n), kind="stable")
    share = np.empty(n)
    share[order] = (np.arange(n) + 0.5) / n
    way = np.clip((share - GREEN_LEFT) / (1 - GREEN_LEFT), 0, 1) ** mood
    return np.where(share < GREEN_LEFT, 0.0, 0.12 + 0.83 * way)


def _mottle(atlas: Atlas, cells: Cells, rng: np.random.Generator) -> NDArray[np.float64]:
    """How much farther or less each solid texel (N,) has turned than its leaf: margins first, and in patches."""
    solid = (atlas.rgba[..., 3] >= SOLID * 255).astype(np.uint8)
    depth = cv2.distanceTransform(solid, cv2.DIST_L2, cv2.DIST_MASK_5)[cells.row, cells.column]
    deepest = np.zeros(cells.n)
    np.maximum.at(deepest, cells.of, depth)
    inward = depth / np.maximum(deepest[cells.of], 1)
    noise = cv2.GaussianBlur(rng.normal(size=solid.shape).astype(np.float32), (0, 0), MOTTLE_PX)
    patch = noise[cells.row, cells.column]
    patch = patch / (patch.std() + 1e-9)
    return np.asarray(MARGIN * (0.35 - inward) + MOTTLE * patch, float)


def fallen(
    leaves: Leaves, season: Season, *, evergreen: bool = False, share: float = FALLEN, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Which leaves (K,), ascending, have fallen: none in summer, a share in autumn, all in winter.

    In autumn the wind takes leaves from the top and the outside first. An evergreen loses none.

    Raises:
        ValueError: the share is not in [0, 1], or there is no such season.
    """
    if season not in SEASONS:
        raise ValueError(f"{season!r} is no season; expected one of {', '.join(SEASONS)}")
    if not 0 <= share <= 1:
        raise ValueError(f"share is {share}; expected 0 to 1")
    if evergreen or season in ("photo", "summer") or not len(leaves):
        return np.zeros(0, np.int64)
    if season == "winter":
        return np.arange(len(leaves), dtype=np.int64)
    # weighted sampling without replacement (Efraimidis & Spirakis 2006): the least of -log(u) / weight
    key = -np.log(rng.uniform(np.finfo(float).tiny, 1, len(leaves))) / exposure(leaves.position)
    return np.sort(np.argsort(key, kind="stable")[: round(share * len(leaves))])


def exposure(position: NDArray[np.float64]) -> NDArray[np.float64]:
    """How readily the wind takes leaves (L,) at places (L, 3): least in the middle and below, most on the top."""
    low, middle, high = np.percentile(position, [2, 50, 98], axis=0)
    half = np.maximum((high - low) / 2, 1e-6)
    outward = np.clip(np.linalg.norm((position - middle) / half, axis=1), 0, 1.2)
    upward = np.clip((position[:, 1] - low[1]) / (2 * half[1]), 0, 1)
    return np.asarray((0.25 + outward**2) * (0.5 + upward), float)
