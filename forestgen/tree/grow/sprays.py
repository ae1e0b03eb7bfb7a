"""Sprays: twigs along the tufts that the photo shows beyond all wood, by the way that crosses the least sky.

Each pixel of foliage has a cheapest way to the wood in the picture: through foliage where it can,
over sky where it must. The farthest pixel gets a twig along its way, and whatever lies near that
twig is served; then the farthest of the rest, and so on (as TEASAR finds the middle lines of
tubular shapes, Sato et al. 2000). So tips too thin for attractors in space have wood, and that
wood lies where the photo has room for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow.crown_volume import CrownVolume
from forestgen.tree.grow.ways import FAR, STRAIGHT, cheapest_ways

LEAF_COST, WOOD_COST, SKY_COST = 1, 4, 40  # of a pixel that a way steps on
STEP = 0.008  # of the height, between the nodes of a spray
LEAST = 0.3  # of the spacing's square: foliage that a spray serves at least
SPARE = 3.0  # pixels of foliage that it serves at least for each pixel of sky that it crosses
SLOPE = 0.3  # toward the camera or away, over the way in the picture: standard deviation
STRAY_PX = 0.8  # a spray strays no farther from its way in the picture
SHIFT = 4  # binary digits of a pixel that lines are drawn to


@dataclass(frozen=True, eq=False)
class _Picture:
    """A tree's wood in one view, about the crown."""

    cost: NDArray[np.uint8]  # (h, w) of a pixel to a way; 0: none leads there
    is_leaf: NDArray[np.bool_]  # (h, w)
    owner: NDArray[np.int32]  # (h, w) the node whose segment is drawn there, -1: none
    corner: NDArray[np.int64]  # (2,) xy of its first pixel in the photo


def grow_sprays(
    position: NDArray[np.float64],
    parent: NDArray[np.int64],
    bare: NDArray[np.int64],
    volume: CrownVolume,
    spacing: float,
    *,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Places and parents of a tree (N,) with sprays to the foliage farther than `spacing` metres from its wood.

    They start from nodes, which stand densely; none from those in `bare`.
    """
    for view, camera in enumerate(volume.cameras):
        picture = _draw(position, parent, bare, volume, view)
        places, above = list(position), parent.tolist()  # lists: a tree is not copied for each of its sprays
        for way in _ways(picture, spacing * camera.px_per_metre):
            _attach(places, above, way, picture, volume, view, rng=rng)
        position, parent = np.array(places), np.array(above, np.int64)
    return position, parent


def _draw(
    position: NDArray[np.float64],
    parent: NDArray[np.int64],
    bare: NDArray[np.int64],
    volume: CrownVolume,
    view: int,
) -> _Picture:
    """What a view shows of the crown, and the wood that may bear sprays."""
    shown, crossable = volume.shown[view], volume.crossable[view]
    rows, columns = np.flatnonzero(crossable.any(axis=1)), np.flatnonzero(crossable.any(axis=0))
    part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    cost = np.where(shown, LEAF_COST, np.where(volume.wooden[view], WOOD_COST, SKY_COST)) * crossable
    owner = np.full(shown.shape, -1, np.int32)
    xy = np.round((np.clip(volume.cameras[view].project(position), -1e4, 1e5) - 0.5) * 2**SHIFT).astype(np.int32)
    bears = np.ones(len(parent), bool)
    bears[[0, *bare]] = False
    ends, above = xy.tolist(), parent.tolist()
    for node in np.flatnonzero(bears).tolist():
        cv2.line(owner, ends[above[node]], ends[node], node, 1, cv2.LINE_8, SHIFT)
    corner = np.array([columns[0], rows[0]])
    return _Picture(cost[part].astype(np.uint8), shown[part], owner[part].copy(), corner)


def _ways(picture: _Picture, near: float) -> Iterator[NDArray[np.int64]]:
    """Ways (K, 2), xy px of the picture's part, from the wood to tips, the farthest first; `near` px are no way."""
    price, following = cheapest_ways(picture.cost, picture.owner >= 0)
    width = price.shape[1]
    served = (price <= near * STRAIGHT).astype(np.uint8)
    tips = np.flatnonzero(picture.is_leaf & (served == 0) & (price < FAR))
    reach = int(np.ceil(near)) + 1
    flat, following, owner = served.ravel(), following.ravel(), picture.owner.ravel()
    for tip in tips[np.argsort(-price.ravel()[tips], kind="stable")].tolist():
        if flat[tip]:
            continue
        way = [tip]
        while following[way[-1]] >= 0 and owner[way[-1]] < 0:
            way.append(int(following[way[-1]]))
        row, column = np.divmod(np.array(way[::-1]), width)
        xy = np.column_stack([column, row])
        low, high = np.maximum(xy.min(axis=0) - reach, 0), xy.max(axis=0) + reach + 1
        window = (slice(low[1], high[1]), slice(low[0], high[0]))
        before = served[window] == 0
        cv2.polylines(served, [xy.astype(np.int32)[:, None]], False, 1, max(1, round(2 * near)))
        won = np.count_nonzero(before & (served[window] > 0) & picture.is_leaf[window])
        over = np.count_nonzero(picture.cost[row, column] == SKY_COST)
        if won >= max(LEAST * near**2, SPARE * over):
            yield xy


def _bends(way: NDArray[np.int64], step: float) -> NDArray[np.int64]:
    """The places (n,) in a way (K, 2) px that a twig along it passes, without its first; at most `step` px apart."""
    bend = cv2.approxPolyDP(way.astype(np.int32)[:, None], STRAY_PX, False)[:, 0]
    index = {tuple(xy): k for k, xy in enumerate(way.tolist())}
    stops = sorted({0, len(way) - 1, *(index[tuple(xy)] for xy in bend.tolist())})
    parts = [np.linspace(a, b, max(1, round((b - a) / step)) + 1)[1:] for a, b in pairwise(stops)]
    return np.rint(np.concatenate(parts or [np.zeros(1)])).astype(np.int64)


def _attach(
    places: list[NDArray[np.float64]],
    above: list[int],
    way: NDArray[np.int64],
    picture: _Picture,
    volume: CrownVolume,
    view: int,
    *,
    rng: np.random.Generator,
) -> None:
    """Put a spray along a way to the tree's places and parents; its pixels are noted as the spray's."""
    camera = volume.cameras[view]
    foot = int(picture.owner[way[0, 1], way[0, 0]])
    at = _bends(way, STEP * volume.height * camera.px_per_metre)
    xy = way[at] + picture.corner + 0.5
    length = np.linalg.norm(np.diff(np.vstack([way[:1] + picture.corner + 0.5, xy]), axis=0), axis=1)
    start = camera.depth(places[foot][None])[0]
    toward = start + SLOPE * rng.normal() * np.cumsum(length) / camera.px_per_metre
    points = camera.unproject(xy, toward)
    n = _reach(points, volume, view)
    first = len(above)
    for k in range(n):
        part = way[(at[k - 1] if k else 0) + 1 : at[k] + 1]
        picture.owner[part[:, 1], part[:, 0]] = first + k
    places.extend(points[:n])
    above.extend([foot, *range(first, first + n - 1)][:n])


def _reach(points: NDArray[np.float64], volume: CrownVolume, view: int) -> int:
    """How many of a spray's points (n, 3) the other views allow: they pass where wood may, and end on foliage."""
    passes, ends = np.ones(len(points), bool), np.ones(len(points), bool)
    for other, camera in enumerate(volume.cameras):
        if other != view:
            shown, crossable = volume.shown[other], volume.crossable[other]
            column, row = np.floor(camera.project(points)).astype(np.int64).T
            seen = (column >= 0) & (row >= 0) & (column < shown.shape[1]) & (row < shown.shape[0])
            column, row = np.where(seen, column, 0), np.where(seen, row, 0)
            passes &= seen & crossable[row, column]
            ends &= seen & shown[row, column]
    last = np.flatnonzero(np.logical_and.accumulate(passes) & ends)
    return int(last[-1]) + 1 if len(last) else 0
