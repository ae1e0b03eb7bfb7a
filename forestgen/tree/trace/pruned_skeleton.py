"""PrunedSkeleton: medial lines of the visible wood, pruned by parts of its outline (Kim & Jeong 2014, sec. II.2)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.errors import InputError
from forestgen.tree.strokes import SkeletonEdits, Strokes
from forestgen.tree.trace.curve_evolution import FEWEST, Contours, evolve, outlines_of
from forestgen.tree.trace.half_width import edge_distance
from forestgen.tree.trace.polylines import drawn_height
from forestgen.tree.trace.pruned_skeleton_parts import carried_on, convex, parts_of, pruned
from forestgen.tree.trace.smooth_paths import SmoothPaths
from forestgen.tree.trace.wood_model import WoodModel
from forestgen.tree.trace.wood_network import WoodNetwork, cut_at_junctions

EDIT_REACH = 0.02  # of the tree's height: so near to a vertex, or to the outline, a person's point means it


@dataclass(frozen=True, kw_only=True)
class PrunedSkeleton(SmoothPaths):
    """A branch ends where the wood's outline keeps a convex vertex in discrete curve evolution, and nowhere else.

    The outline is cut into parts at these vertices; what one part alone made of the medial lines is
    noise (Bai et al. 2007). A photo shows wood in many parts, with holes: all outlines evolve
    together, and the parts are joined to one tree as `SmoothPaths` does, whose settings are these too.
    """

    vertices: int = 0  # m of algorithm 1, for all outlines together; its value is the user's, none is printed.
    # 0: as many as have the relevance below, so that a tree of many twigs keeps more than one of few
    relevance: float = 0.004  # least R that a vertex is worth, lengths as shares of the tree's height; ours

    def __post_init__(self) -> None:
        if self.vertices and self.vertices < FEWEST:
            raise ValueError(f"vertices is {self.vertices}; expected at least {FEWEST}, or 0 to go by relevance")
        if not self.relevance >= 0:
            raise ValueError(f"relevance is {self.relevance}; expected 0 or more")

    def network(
        self, model: WoodModel, is_stroke: NDArray[np.bool_], foot: NDArray[np.bool_], strokes: Strokes
    ) -> WoodNetwork:
        """The pruned medial lines of the visible wood and of the strokes (H, W), without the trunk's foot."""
        wood, tall = model.wood | is_stroke, drawn_height(strokes)
        contours = outlines_of(wood)
        kept = evolve(
            contours,
            whole=tall,
            fewest=self.vertices or FEWEST,
            least=np.inf if self.vertices else self.relevance,
        )
        vertices = edited(contours, convex(contours, kept), strokes.skeleton, EDIT_REACH * tall)
        thin = pruned_thin(wood, contours, vertices)
        if len(strokes.skeleton.vertices):
            thin = reaching(thin, strokes.skeleton.vertices)
        return cut_at_junctions(thin & ~foot)

    def without_bumps(
        self, xy: NDArray[np.float64], parent: NDArray[np.int64], width: NDArray[np.float64], strokes: Strokes
    ) -> NDArray[np.int64]:
        """Indices of the nodes (N,) that are no bumps, or lead to a vertex that a person added."""
        kept = np.zeros(len(xy), bool)
        kept[super().without_bumps(xy, parent, width, strokes)] = True
        for place in strokes.skeleton.vertices:
            node = int(np.argmin(np.hypot(*(xy - place).T)))
            while node >= 0 and not kept[node]:
                kept[node] = True
                node = int(parent[node])
        return np.flatnonzero(kept)


def pruned_thin(wood: NDArray[np.bool_], contours: Contours, vertices: NDArray[np.int64]) -> NDArray[np.bool_]:
    """The medial lines (H, W) of wood whose branches end at these vertices (V,) of its outlines."""
    from skimage.morphology import skeletonize  # its import is felt

    thin: NDArray[np.bool_] = skeletonize(np.array(wood))  # type: ignore[no-untyped-call]
    if not len(contours):
        return thin
    thin = pruned(thin, contours, parts_of(contours, vertices))
    return carried_on(thin, wood, edge_distance(wood))


def reaching(thin: NDArray[np.bool_], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """The thinned mask (H, W) with a straight line from each point (K, 2) px to its nearest place: a branch ends there.

    Where thinning made an end there, the line is nought.
    """
    row, column = np.nonzero(thin)
    if not len(row):
        return thin
    drawn, places = thin.astype(np.uint8), np.column_stack([column, row])
    _, nearest = cKDTree(places + 0.5).query(points)
    size = np.array(thin.shape[::-1]) - 1
    for point, place in zip(np.clip(points.astype(int), 0, size).tolist(), places[nearest].tolist(), strict=True):
        cv2.line(drawn, place, point, 1)
    return drawn > 0


def edited(contours: Contours, vertices: NDArray[np.int64], edits: SkeletonEdits, reach_px: float) -> NDArray[np.int64]:
    """The vertices (V,) without those that a person merged away, and with those that he added.

    Raises:
        InputError: a point is farther than `reach_px` from any vertex, or from the outline.
    """
    gone = _nearest(contours.xy[vertices], edits.merge, reach_px, "merge", "a vertex of the wood's outline")
    new = _nearest(contours.xy, edits.vertices, reach_px, "vertices", "the wood's outline")
    return np.union1d(np.delete(vertices, gone), new)


def _nearest(
    places: NDArray[np.float64], points: NDArray[np.float64], reach_px: float, key: str, what: str
) -> NDArray[np.int64]:
    """The index (K,) of the place nearest to each point (K, 2) px."""
    if not len(points):
        return np.empty(0, np.int64)
    away, index = cKDTree(places).query(points) if len(places) else (np.full(len(points), np.inf), points[:, 0])
    for k in np.flatnonzero(away > reach_px)[:1]:
        nearest = f"; the nearest is [{places[index[k], 0]:.0f}, {places[index[k], 1]:.0f}]" if len(places) else ""
        raise InputError(
            f"strokes: skeleton.{key}[{k + 1}]: expected a point within {reach_px:.0f} px of {what},"
            f" came [{points[k, 0]:g}, {points[k, 1]:g}]{nearest}; move or delete it"
        )
    return np.asarray(index, np.int64)
