"""Smooth paths: all wood that the branch matte shows, joined to one tree by shortest ways that dislike turning."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.errors import StageError
from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.strategy import Strategy
from forestgen.tree.strokes import Strokes, draw_polyline
from forestgen.tree.trace.assembly import assemble
from forestgen.tree.trace.centre_lines import centre_lines, without_twiglets
from forestgen.tree.trace.gap_links import LinkRules
from forestgen.tree.trace.half_width import at_points, raw_half_width
from forestgen.tree.trace.network_tree import WayPrices, span
from forestgen.tree.trace.polylines import drawn_height, length_along, point_at, resample
from forestgen.tree.trace.stroke_routes import route_stroke
from forestgen.tree.trace.wood_model import WoodModel, wood_model
from forestgen.tree.trace.wood_network import WoodNetwork, wood_network


@dataclass(frozen=True, kw_only=True)
class SmoothPaths(Strategy):
    """Every piece of wood seen in the photo, on its medial line and as wide as it is there.

    Ours, and the default instead of the circle of Tan et al. 2008, sec. 2: that one finds a fifth
    of the visible wood (benchmarks/tracing.py), since it stops at the first leaf and cannot see
    forks nearer than its radius. Lengths are shares of the tree's height in the photo.
    """

    slide: float = 0.012  # a stroke slides to wood this near
    least_wood: float = 0.008  # shorter visible wood is noise
    least_twig: float = 0.007  # a side branch that leaves its parent by less is a bump
    leaf_hole: float = 0.02  # a leaf this large, with wood all around, lies before one limb
    view: float = 0.016  # directions are seen over this length
    turn: float = 0.15  # a turn by 90 degrees costs as much as this length of wood
    on_stroke: float = 0.35  # price of a length under a stroke; plain wood costs 1
    hidden: float = 2.5  # price of a hidden length
    least_linked: float = 0.015  # wood seen for less than this beyond leaves is not worth a link
    longest_link: float = 0.16  # a branch is hidden behind leaves for at most this length
    longest_share: float = 3.0  # nor for longer than this many times the visible length beyond
    most_open: float = 0.15  # of a link may lie before open background
    smooth: float = 0.004  # sigma along a branch; wider wood is smoothed more
    off_line: float = 0.0007  # a polyline's greatest distance from its smooth line
    longest_edge: float = 0.04  # between two nodes

    def __call__(self, photo: Photo, strokes: Strokes, mattes: Mattes, *, rng: np.random.Generator) -> BranchGraph:
        return self.trace(self.prepare(mattes, strokes), strokes)

    def prepare(self, mattes: Mattes, strokes: Strokes) -> WoodModel:
        """Clean the branch matte: what does not change while strokes are drawn."""
        tall = drawn_height(strokes)
        return wood_model(mattes, round(self.least_wood * tall), (self.leaf_hole * tall) ** 2)

    def trace(self, model: WoodModel, strokes: Strokes) -> BranchGraph:
        """The graph of all visible wood, along the strokes first."""
        tall = drawn_height(strokes)
        is_stroke = np.zeros(model.wood.shape, bool)
        size = (model.wood.shape[1], model.wood.shape[0])
        routes = [route_stroke(path, model.distance, max(self.slide * tall, 2)) for path in strokes.branches]
        for route in routes:
            is_stroke |= draw_polyline(route, size)
        start, foot = trunk_foot(model.distance, routes[0])
        network = self.network(model, is_stroke, foot, strokes)
        prices = WayPrices(
            turn_px=self.turn * tall,
            view_px=max(self.view * tall, 6),
            on_stroke=self.on_stroke,
            links=LinkRules(
                longest_px=self.longest_link * tall,
                least_piece_px=self.least_linked * tall,
                longest_share=self.longest_share,
                price=self.hidden,
                most_open=self.most_open,
                every_px=max(self.least_wood * tall / 2, 1),
            ),
        )
        tree = span(
            network,
            resample(strokes.branches[0], 4.0),
            entries(network, start, 0.05 * tall),
            distance=model.distance,
            is_stroke=cv2.dilate(is_stroke.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0,
            is_covered=model.is_covered,
            prices=prices,
        )
        xy, parent, hidden = np.array(tree.xy), np.array(tree.parent), np.array(tree.is_hidden)
        width = raw_half_width(model.distance, xy)
        kept = self.without_bumps(xy, parent, width, strokes)
        place = np.full(len(xy), -1)
        place[kept] = np.arange(len(kept))
        above = np.where(parent[kept] < 0, -1, place[parent[kept]])
        leafy = cv2.blur(model.is_foliage.astype(np.float32), (9, 9))
        trust = 1 / (1 + 20 * at_points(leafy, xy[kept]))
        lines = centre_lines(xy[kept], above, width[kept], hidden[kept], trust, max(self.smooth * tall, 1.5))
        return assemble(lines, model, off_px=max(self.off_line * tall, 0.6), longest_px=self.longest_edge * tall)

    def network(
        self, model: WoodModel, is_stroke: NDArray[np.bool_], foot: NDArray[np.bool_], strokes: Strokes
    ) -> WoodNetwork:
        """Medial lines of the visible wood and of the strokes (H, W), without the trunk's `foot` (H, W)."""
        return wood_network(model.wood | is_stroke, model.distance, foot)

    def without_bumps(
        self, xy: NDArray[np.float64], parent: NDArray[np.int64], width: NDArray[np.float64], strokes: Strokes
    ) -> NDArray[np.int64]:
        """Indices of the nodes (N,) of the traced tree that are no bumps of its outline."""
        return without_twiglets(xy, parent, width, max(self.least_twig * drawn_height(strokes), 4))


def trunk_foot(
    distance: NDArray[np.float32], trunk: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The trunk's foot (H, W), about as high as the trunk is wide, and the point (2,) px where the trunk leaves it.

    `trunk` (K, 2) px is the trunk stroke, slid onto the wood.
    """
    length = length_along(trunk)
    early = point_at(trunk, np.linspace(0, length[-1] / 3, 40))
    width = float(np.median(raw_half_width(distance, early)))
    high = min(1.6 * width + 3, length[-1] / 3)
    leave = point_at(trunk, np.array([high]))[0]
    up = (leave - trunk[0]) / max(float(np.hypot(*(leave - trunk[0]))), 1e-9)
    row, column = np.ogrid[: distance.shape[0], : distance.shape[1]]
    x, y = column + 0.5 - trunk[0, 0], row + 0.5 - trunk[0, 1]
    foot = (x * up[0] + y * up[1] <= high) & (abs(x * up[1] - y * up[0]) <= 3 * high)
    return leave, np.asarray(foot)


def entries(network: WoodNetwork, point: NDArray[np.float64], least_px: float) -> list[tuple[int, int]]:
    """Where the tree enters the network near a point (2,) px: (piece, which end), all pieces of a junction.

    Parts of the network shorter in all than `least_px` are no trunk.

    Raises:
        StageError: there is no wood at all.
    """
    if not len(network):
        raise StageError("no wood was found under the branch strokes: draw the trunk from the ground into the crown")
    ends = np.array([[points[0], points[-1]] for points in network.points])
    total = np.bincount(network.component, weights=network.length)[network.component]
    away = np.hypot(*np.moveaxis(ends - point, 2, 0)) + (total < min(least_px, total.max()))[:, None] * 1e6
    piece, side = (int(i) for i in np.unravel_index(int(np.argmin(away)), away.shape))
    junction = network.ends[piece, side]
    return [(piece, side)] if junction < 0 else list(network.pieces_at[junction])
