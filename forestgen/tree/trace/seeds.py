"""Seeds of the live-wire: tips of visible wood, random points on the silhouette (Neubert et al. 2007, sec. 4)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.mattes import Mattes
from forestgen.tree.scale import disc, own_part
from forestgen.tree.strokes import Strokes, fill_outline
from forestgen.tree.trace.wood_model import WoodModel
from forestgen.tree.trace.wood_network import wood_network

CLOSE = 0.04  # of the crown's height: gaps in the crown up to this wide are no silhouette
FOOT = 0.06  # of the tree's height in the photo: lower, wood ends at the ground and not in a tip
ASTRAY = 0.05  # of the crown's height: a seed farther from the tree is none


def wood_tips(model: WoodModel, mattes: Mattes, strokes: Strokes) -> NDArray[np.float64]:
    """Points (K, 2) px where the medial lines of the tree's own visible wood end."""
    network = wood_network(model.wood, model.distance, np.zeros(model.wood.shape, bool))
    if not len(network):
        return np.empty((0, 2))
    ends = np.array([[points[0], points[-1]] for points in network.points])
    free = ends[network.ends < 0]
    own = own_part(mattes.is_tree | model.wood, strokes)
    column, row = free.astype(int).T
    lowest = strokes.root[1] - FOOT * (strokes.root[1] - strokes.crown[:, 1].min())
    return np.asarray(free[own[row, column] & (free[:, 1] < lowest)])


def silhouette_seeds(mattes: Mattes, strokes: Strokes, count: int, *, rng: np.random.Generator) -> NDArray[np.float64]:
    """`count` points (count, 2) px on the crown's silhouette, at random but evenly, in random order.

    What there is of the tree inside the crown outline counts; none where that is nothing.
    """
    crown = own_part(mattes.is_tree, strokes) & fill_outline(strokes.crown, mattes.foliage.shape[::-1])
    tall = float(np.ptp(strokes.crown[:, 1]))
    solid = cv2.morphologyEx(crown.astype(np.uint8), cv2.MORPH_CLOSE, disc(CLOSE * tall / 2))
    outlines, _ = cv2.findContours(solid, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not outlines or count < 1:
        return np.empty((0, 2))
    points = max(outlines, key=len)[:, 0].astype(np.float64) + 0.5
    place = (np.arange(count) + rng.random(count)) / count * len(points)
    return np.asarray(points[rng.permutation(place.astype(int))])


def far_from_tree(points: NDArray[np.float64], mattes: Mattes, strokes: Strokes) -> NDArray[np.bool_]:
    """Which points (K, 2) px lie off the tree and off its crown by more than a twig's length."""
    outside = ~(fill_outline(strokes.crown, mattes.foliage.shape[::-1]) | mattes.is_tree)
    away = cv2.distanceTransform(np.asarray(outside, np.uint8), cv2.DIST_L2, 5)
    height, width = away.shape
    column, row = np.clip(points.astype(int), 0, [width - 1, height - 1]).T
    return np.asarray(away[row, column] > ASTRAY * np.ptp(strokes.crown[:, 1]))
