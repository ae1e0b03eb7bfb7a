"""Score a tree: what its written stage draws, against each view it was made from; gates decide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from forestgen.check import metrics
from forestgen.errors import InputError
from forestgen.render import Drawable, Studio
from forestgen.tree.painted import painted_over
from forestgen.tree.view import View

OVERHANG = 0.01  # of the height: margin around painted foliage in which colours are not compared
HALF = 0.495  # covered from one half of the samples on; half of them is 127/255 on some drivers


@dataclass(frozen=True, kw_only=True)
class Gates:
    """What a build must reach, per view; None where a measure is no gate. Defaults: DESIGN section 6."""

    envelope_iou: float | None = 0.90
    silhouette_iou: float | None = None
    skill: float | None = 0.4  # not asked of a bare tree
    boundary_f: float | None = 0.85
    branch_chamfer: float | None = 0.015  # at most, share of the height
    gap_recall: float | None = None
    density_correlation: float | None = None
    colour_delta_e: float | None = 8.0  # at most

    def failed(self, scores: Mapping[str, float], *, is_bare: bool) -> tuple[str, ...]:
        """Names of the gates that these scores miss."""
        missed = []
        for gate in fields(self):
            limit = getattr(self, gate.name)
            if limit is None or (is_bare and gate.name == "skill"):
                continue
            score = scores[gate.name]
            reached = score <= limit if gate.name in AT_MOST else score >= limit
            if not reached:
                missed.append(gate.name)
        return tuple(missed)


MEASURES = tuple(gate.name for gate in fields(Gates))
AT_MOST = frozenset({"branch_chamfer", "colour_delta_e"})  # the other measures are better when greater


def make_gates(settings: Mapping[str, float]) -> Gates:
    """The default gates with some thresholds replaced.

    Raises:
        InputError: a name that is no measure.
    """
    for name in settings:
        if name not in MEASURES:
            raise InputError(f"gates: {name!r} is no measure; there are {', '.join(MEASURES)}")
    return replace(Gates(), **settings)


@dataclass(frozen=True, eq=False)
class Drawn:
    """The tree as its stage shows it through one view's camera."""

    colour: NDArray[np.float32]  # (H, W, 3) unlit, sRGB-encoded, 0 where nothing is
    is_tree: metrics.Mask  # (H, W)
    is_leaf: metrics.Mask  # (H, W) a leaf is in front
    is_wood: metrics.Mask  # (H, W) wood is in front


@dataclass(frozen=True, eq=False)
class ViewScore:
    """The measures of one view, and which gates they miss."""

    photo: str
    azimuth: float  # degrees
    is_bare: bool
    scores: Mapping[str, float]
    failed: tuple[str, ...]
    drawn: Drawn


def draw(studio: Studio, view: View) -> Drawn:
    """Draw the tree through a view's camera at the photo's size."""
    colour, front = studio.colour_and_classes(view.camera)
    share = colour[..., 3:]
    return Drawn(
        colour=np.divide(colour[..., :3], share, out=np.zeros_like(colour[..., :3]), where=share > 0),
        is_tree=share[..., 0] >= HALF,
        is_leaf=front[..., 0] >= HALF,
        is_wood=front[..., 1] >= HALF,
    )


def measure(view: View, drawn: Drawn, height: float) -> dict[str, float]:
    """All measures of one view of a tree `height` metres tall; distances as shares of the height."""
    height_px = height * view.camera.px_per_metre
    reference, render = view.mattes.is_tree, drawn.is_tree
    # of painted foliage the photo knows no colour; its leaves reach a little over what was painted
    shown = ~painted_over(view.strokes.density, reference.shape, OVERHANG * height_px)
    outer = metrics.envelope(reference, height_px)
    drawn_outer = metrics.envelope(render, height_px)
    crown = np.clip(view.strokes.crown, 0, view.photo.size)
    box = (*crown.min(axis=0).tolist(), *crown.max(axis=0).tolist())
    return {
        "envelope_iou": metrics.iou(outer, drawn_outer),
        "silhouette_iou": metrics.iou(reference, render),
        "skill": metrics.skill(reference, render, outer, height_px),
        "boundary_f": metrics.boundary_f(outer, drawn_outer, height_px),
        "branch_chamfer": metrics.branch_chamfer(
            metrics.points_along(view.branches.xy, view.branches.parent),
            view.mattes.is_foliage,
            drawn.is_wood,
            drawn.is_leaf,
            height_px,
        ),
        "gap_recall": metrics.gap_recall(reference, render, outer),
        "density_correlation": metrics.density_correlation(reference, render, box),
        "colour_delta_e": metrics.colour_delta_e(
            view.photo.rgb.astype(np.float32) / np.float32(255),
            reference & shown,
            drawn.colour,
            render & shown,
            outer,
            height_px,
        ),
    }


def score_views(studio: Studio, views: Sequence[View], height: float, gates: Gates) -> list[ViewScore]:
    """Draw a tree through the camera of each of its views, measure, and hold it against the gates."""
    rows = []
    for view in views:
        drawn = draw(studio, view)
        scores = measure(view, drawn, height)
        is_bare = view.mattes.is_bare
        failed = gates.failed(scores, is_bare=is_bare)
        rows.append(ViewScore(view.photo.name, np.degrees(view.camera.azimuth), is_bare, scores, failed, drawn))
    return rows


def count(drawables: Sequence[Drawable]) -> dict[str, int]:
    """What the stage holds: leaves, triangles as drawn, leaf prototypes."""
    leaves = [d for d in drawables if d.is_leaf]
    return {
        "leaves": sum(len(d.transforms) for d in leaves),
        "triangles": sum(d.n_triangles for d in drawables),
        "prototypes": len(leaves),
    }
