"""LiveWire: cheapest ways from many seeds to the root make the attractor graph (Neubert et al. 2007, sec. 4)."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.strategy import Strategy
from forestgen.tree.strokes import Strokes, draw_polyline
from forestgen.tree.trace.assembly import assemble
from forestgen.tree.trace.centre_lines import centre_lines, without_twiglets
from forestgen.tree.trace.half_width import at_points, raw_half_width
from forestgen.tree.trace.minimal_paths import STEPS, WayTree, cheapest_ways
from forestgen.tree.trace.polylines import drawn_height
from forestgen.tree.trace.seeds import far_from_tree, silhouette_seeds, wood_tips
from forestgen.tree.trace.stroke_routes import route_stroke
from forestgen.tree.trace.way_prices import PriceMap, price_map
from forestgen.tree.trace.wood_model import WoodModel, wood_model

log = logging.getLogger(__name__)

OFF_CELL = 0.1  # px of half width that a place must gain for each px it lies off its cell's middle


@dataclass(frozen=True, kw_only=True)
class LiveWire(Strategy):
    """Every seed's cheapest way to the foot of the tree, along wood where it is seen.

    The paper's live-wire (Chodorowski et al. 2005) follows the image's edges from seeds to a
    target; here the branch matte says where wood is. Where none is seen, leaves cost more than
    wood by a constant: a way through them is straight and meets its limb at the angle whose cosine
    is the ratio of the prices, 60 degrees, as light is refracted. The trunk stroke is always part
    of the graph, so that a way to the first fork and a way to the foot are the same. Lengths are
    shares of the tree's height in the photo.
    """

    seeds: Literal["strokes", "silhouette", "both"] = "strokes"  # sec. 4: by hand "usually creates better results"
    n_silhouette: int = 24  # random seeds on the silhouette; the paper is silent
    cells: int = 400  # the grid of the ways is so fine that the tree is this high
    wood: float = 0.5  # price of a length of wood or stroke; leaves cost 1
    traced: float = 0.7  # share of its price that a length costs on which a way of an earlier batch runs
    sky: float = 8.0  # price of a length before open background
    least_linked: float = 0.015  # wood seen for less than this is not worth a way through leaves
    longest_share: float = 3.0  # nor is wood seen for less than its hidden way divided by this
    slide: float = 0.012  # a stroke slides to wood this near
    least_wood: float = 0.008  # shorter visible wood is noise
    least_twig: float = 0.007  # a side branch that leaves its parent by less is a bump
    leaf_hole: float = 0.02  # a leaf this large, with wood all around, lies before one limb
    smooth: float = 0.006  # sigma along a branch; wider wood is smoothed more
    off_line: float = 0.0007  # a polyline's greatest distance from its smooth line
    longest_edge: float = 0.04  # between two nodes

    def __call__(self, photo: Photo, strokes: Strokes, mattes: Mattes, *, rng: np.random.Generator) -> BranchGraph:
        """The attractor graph, rooted at the trunk stroke's start. Radii are NaN where no wood is seen."""
        tall = drawn_height(strokes)
        model = wood_model(mattes, round(self.least_wood * tall), (self.leaf_hole * tall) ** 2)
        routes, is_stroke = self.slid(model, strokes, tall)
        drawn_points = np.concatenate([strokes.crown, *strokes.branches])
        prices = price_map(model, is_stroke, drawn_points, tall, self.cells, wood=self.wood, leaf=1.0, sky=self.sky)
        ways = WayTree([int(prices.cell(strokes.root[None])[0])])
        drawn, tips, silhouette = self.all_seeds(model, mattes, strokes, routes, rng=rng)
        for batch in drawn:
            trace_ways(prices, ways, batch, self.traced)
        least = self.least_linked * tall / prices.factor
        trace_ways(prices, ways, tips, self.traced, lambda way: worth_a_way(way, prices, least, self.longest_share))
        for batch in np.split(silhouette, [len(silhouette) // 6, len(silhouette) // 2]):
            trace_ways(prices, ways, batch, self.traced)
        return self.graph(model, ways, prices, strokes.root, tall)

    def slid(
        self, model: WoodModel, strokes: Strokes, tall: float
    ) -> tuple[list[NDArray[np.float64]], NDArray[np.bool_]]:
        """The strokes slid onto the wood beside them, and the pixels (H, W) under them."""
        size = (model.wood.shape[1], model.wood.shape[0])
        routes = [route_stroke(path, model.distance, max(self.slide * tall, 2)) for path in strokes.branches]
        under = np.zeros(model.wood.shape, bool)
        for route in routes:
            under |= draw_polyline(route, size)
        return routes, under

    def all_seeds(
        self,
        model: WoodModel,
        mattes: Mattes,
        strokes: Strokes,
        routes: list[NDArray[np.float64]],
        *,
        rng: np.random.Generator,
    ) -> tuple[list[NDArray[np.float64]], NDArray[np.float64], NDArray[np.float64]]:
        """Seeds (K, 2) px: the strokes' tips, the trunk's first and alone; tips of visible wood; the silhouette's."""
        tips = np.array([route[-1] for route in routes])
        astray = far_from_tree(tips, mattes, strokes)
        astray[0] = False
        if astray.any():
            log.warning("%d branch strokes end far from the tree and are no seeds", astray.sum())
        none = np.empty((0, 2))
        by_hand, at_random = self.seeds != "silhouette", self.seeds != "strokes"
        return (
            [tips[:1], tips[1:][~astray[1:]] if by_hand else none],
            wood_tips(model, mattes, strokes) if by_hand else none,
            silhouette_seeds(mattes, strokes, self.n_silhouette, rng=rng) if at_random else none,
        )

    def graph(
        self, model: WoodModel, ways: WayTree, prices: PriceMap, root: NDArray[np.float64], tall: float
    ) -> BranchGraph:
        """The ways as smooth branches with few nodes, as thick as the wood seen there."""
        xy = centred(prices.place(np.array(ways.pixel)), model.distance, prices.factor)
        xy[0] = root
        parent = np.array(ways.parent)
        width = raw_half_width(model.distance, xy)
        kept = without_twiglets(xy, parent, width, max(self.least_twig * tall, 4))
        place = np.full(len(xy), -1)
        place[kept] = np.arange(len(kept))
        above = np.where(parent[kept] < 0, -1, place[parent[kept]])
        leafy = cv2.blur(model.is_foliage.astype(np.float32), (9, 9))
        trust = 1 / (1 + 20 * at_points(leafy, xy[kept]))
        hidden = width[kept] <= 0
        lines = centre_lines(xy[kept], above, width[kept], hidden, trust, max(self.smooth * tall / prices.factor, 1.5))
        return assemble(lines, model, off_px=max(self.off_line * tall, 0.6), longest_px=self.longest_edge * tall)


def trace_ways(
    prices: PriceMap,
    ways: WayTree,
    seeds: NDArray[np.float64],
    traced: float,
    is_wanted: Callable[[list[int]], bool] = bool,
) -> None:
    """Join the wanted ways from seeds (K, 2) px to the tree, cheapest first; the tree so far is cheaper to follow."""
    if not len(seeds):
        return
    price = prices.price.copy()
    price.reshape(-1)[ways.pixel] *= traced
    cost, onward = cheapest_ways(price, ways.pixel[0], STEPS)
    cells = np.unique(prices.cell(seeds))
    cells = cells[np.isfinite(cost[cells])]
    for cell in cells[np.argsort(cost[cells], kind="stable")]:
        way = ways.way(int(cell), onward)
        if is_wanted(way):
            ways.join(way, onward)


def worth_a_way(way: list[int], prices: PriceMap, least: float, longest_share: float) -> bool:
    """Whether enough wood is seen along a way (cells): `least` cells, and its hidden part over `longest_share`."""
    seen = np.count_nonzero(prices.distance.reshape(-1)[way])
    hidden = len(way) - seen
    return bool(way) and bool(hidden == 0 or (seen >= least and hidden <= longest_share * seen))


def centred(points: NDArray[np.float64], distance: NDArray[np.float32], reach_px: float) -> NDArray[np.float64]:
    """Points (N, 2) px moved to the middle of the wood (distance to its edge (H, W)) within a coarse cell."""
    reach = int(np.ceil(reach_px))
    best, moved = np.zeros(len(points)), points.copy()
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            there = points + np.array([dx, dy])
            score = at_points(distance, there) - OFF_CELL * (dx * dx + dy * dy) / max(reach, 1)
            better = score > best
            best[better], moved[better] = score[better], there[better]
    return moved
