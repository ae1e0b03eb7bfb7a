"""The figures of Kim & Jeong 2014, from our own trees; run from the checkout's root.

    python -m docs.make_kim_pictures out/growing docs/kim2014

Reads the built sample scene `growing` and the winter oak of `scenes/street`, and writes figure_2.jpg (mattes of toy
pictures), figure_4.jpg (skeletons), figure_7.jpg (grafted units), figure_8.jpg (tropism) and figure_9.jpg (growth).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.morphology import skeletonize

from benchmarks.normalized_matting import strip
from docs.make_neubert_pictures import PAPER, Picture, in_rows, write_figures
from forestgen.arrays import stage_rng
from forestgen.check import pictures
from forestgen.reference import read_provenance, read_views
from forestgen.tree.grow.grafting import Grafting
from forestgen.tree.growth import Growth
from forestgen.tree.methods import METHODS
from forestgen.tree.photo import load_photo
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strokes import load_strokes
from forestgen.tree.trace.curve_evolution import evolve, outlines_of
from forestgen.tree.trace.pruned_skeleton import pruned_thin
from forestgen.tree.trace.pruned_skeleton_parts import convex
from forestgen.tree.view import View

TREE = "cherry_pink"
OAK = Path("scenes/street/photos/oak_winter.jpg"), Path("stroke_sets/street/oak_winter.json")
WINDOW = slice(330, 730), slice(480, 860)  # rows and columns of the oak's picture that figure 4 shows
TROPISMS = (20.0, 0.0, -7.0, -14.0, -25.0)  # figure 8
AGES = (0.1, 0.25, 0.45, 0.7, 1.0)
LINE, WOOD, END = (208, 52, 44), (205, 199, 190), (47, 109, 143)


def figure_2() -> Picture:
    """Scribbles, truth, closed form and normalized matte: toy pictures with few and with many scribbles a row."""
    rows = [[strip(kind, 0.0, number) for number in (1, 20)] for kind in ("disc", "fork", "rings")]
    return in_rows(rows)


def figure_4() -> Picture:
    """The winter oak's wood: thinned; pruned by contour parts; and by ever fewer vertices (thick dots)."""
    photo = load_photo(OAK[0])
    strokes = load_strokes(OAK[1], photo.size)
    wood = METHODS["kim2014"].segment(photo, strokes, rng=stage_rng(7, "segment", 0)).is_branch
    contours, tall = outlines_of(wood), float(np.ptp(strokes.crown[:, 1]))
    drawn = [_lines_over(wood, skeletonize(wood), np.zeros((0, 2)))]
    for fewest, least in ((3, 0.004), (400, np.inf), (150, np.inf)):
        vertices = convex(contours, evolve(contours, whole=tall, fewest=fewest, least=least))
        drawn.append(_lines_over(wood, pruned_thin(wood, contours, vertices), contours.xy[vertices]))
    return in_rows([drawn])


def _lines_over(wood: NDArray[np.bool_], thin: NDArray[np.bool_], vertices: NDArray[np.float64]) -> Picture:
    """Wood (H, W) with its medial lines and the vertices (V, 2) px that are left of its outline, in the window."""
    canvas = np.full((*wood.shape, 3), PAPER, np.uint8)
    canvas[wood] = WOOD
    canvas[thin] = LINE
    canvas = np.ascontiguousarray(np.kron(canvas[WINDOW], np.ones((2, 2, 1), np.uint8)))
    for x, y in 2 * (vertices - [WINDOW[1].start, WINDOW[0].start]):
        cv2.circle(canvas, (round(x), round(y)), 4, END, -1, cv2.LINE_AA)
    return canvas


def figure_7(view: View, visible: Skeleton) -> Picture:
    """Grafted units of 2, 3 and 4 levels, without a bound, from the front and from above."""
    above = replace(view.camera, elevation=np.pi / 2)
    frame = pictures.frame_view(view)
    rows: list[list[Picture]] = [[], []]
    for levels in (2, 3, 4):
        grown = replace(Grafting.paper(), levels=levels)(visible, [view], rng=stage_rng(7, "grow"))
        grown = METHODS["kim2014"].radius(grown, [view])
        rows[0].append(pictures.skeleton_picture(grown, view.camera, frame))
        shifted = replace(above, root_px=(view.camera.root_px[0], view.photo.size[1] / 2))
        rows[1].append(pictures.skeleton_picture(grown, shifted, frame))
    return in_rows(rows)


def figure_8(view: View, skeleton: Skeleton) -> Picture:
    """The tree at 60 % of its age under five strengths of gravitropism, from +20 to -25 degrees."""
    frame = pictures.frame_view(view)
    grown = [Growth(tropism_deg=angle)(skeleton).at(0.6) for angle in TROPISMS]
    return in_rows([[pictures.skeleton_picture(tree, view.camera, frame) for tree in grown]])


def figure_9(view: View, skeleton: Skeleton) -> Picture:
    """Ages of the tree in the three modes: no scaling; thickness, size and order; only scaling."""
    frame = pictures.frame_view(view)
    rows: list[Sequence[Picture]] = []
    for mode in ("none", "all", "scale"):
        growing = Growth(mode=mode)(skeleton)
        rows.append([pictures.skeleton_picture(growing.at(age), view.camera, frame) for age in AGES])
    return in_rows(rows)


def main(out: Path, folder: Path) -> None:
    """Write the figures."""
    tree = out / "trees" / TREE
    view, whole = read_views(tree / "reference")[0], read_provenance(tree / "reference").skeleton
    kim = METHODS["kim2014"]
    visible = kim.radius(kim.lift([view], rng=stage_rng(7, "lift")), [view])
    figures = {
        2: figure_2(),
        4: figure_4(),
        7: figure_7(view, visible),
        8: figure_8(view, whole),
        9: figure_9(view, whole),
    }
    write_figures(figures, folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
