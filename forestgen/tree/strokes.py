"""Strokes: what a person drew over one tree in one photo, read, checked and drawn as masks."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
from annotated_types import Ge, Gt, Le, Len
from numpy.typing import NDArray
from pydantic import Field

from forestgen.arrays import freeze
from forestgen.errors import InputError
from forestgen.reading import Table, checked
from forestgen.tree.outline import distance_to_region
from forestgen.tree.photo import MAX_PIXELS
from forestgen.tree.stroke_import import read_stroke_set

VERSION = 1
OVERSHOOT = 0.02  # share of the photo's longer side by which a stroke may leave it; it is drawn back to the edge
TRUNK_GAP = 0.05  # share of the crown's height that may lie between the trunk stroke and the crown


@dataclass(frozen=True, eq=False)
class DensityStroke:
    """Painted foliage (`add`) or a painted hole (Neubert et al. 2007, sec. 9)."""

    add: bool
    radius_px: float
    path: NDArray[np.float64]  # (K, 2) xy px

    def __post_init__(self) -> None:
        freeze(self, path=(np.float64, "K", 2))


NO_POINTS: NDArray[np.float64] = np.empty((0, 2))


@dataclass(frozen=True, eq=False)
class SkeletonEdits:
    """What a person changed about where branches end: vertices of the wood's outline (Kim & Jeong 2014, sec. II.2)."""

    merge: NDArray[np.float64] = field(default_factory=NO_POINTS.copy)  # (K, 2) px, each at a vertex: its two sides
    # become one part of the outline, and the branch between them goes
    vertices: NDArray[np.float64] = field(default_factory=NO_POINTS.copy)  # (K, 2) px: a branch ends here

    def __post_init__(self) -> None:
        freeze(self, merge=(np.float64, "K", 2), vertices=(np.float64, "V", 2))


@dataclass(frozen=True, eq=False)
class Strokes:
    """One tree's strokes in pixels of the upright photo. K points a stroke; all lie inside the photo."""

    crown: NDArray[np.float64]  # (K, 2) closed outline, first point not repeated
    branches: tuple[NDArray[np.float64], ...]  # each (K_i, 2); the first is the trunk, from the root upward
    background: tuple[NDArray[np.float64], ...] = ()  # each (K_i, 2)
    density: tuple[DensityStroke, ...] = ()
    skeleton: SkeletonEdits = field(default_factory=SkeletonEdits)
    size: tuple[int, int] | None = None  # (width, height) of the photo it was drawn on
    photo: str = ""  # a hint for people

    def __post_init__(self) -> None:
        freeze(self, crown=(np.float64, "K", 2))
        for name in ("branches", "background"):
            object.__setattr__(self, name, tuple(_frozen_points(path) for path in getattr(self, name)))
        if len(self.crown) < 3:
            raise ValueError(f"Strokes.crown has {len(self.crown)} points; expected at least 3")
        if not self.branches or any(len(path) < 2 for path in self.branches):
            raise ValueError("Strokes.branches needs the trunk, and at least 2 points in every stroke")
        edits = (self.skeleton.merge, self.skeleton.vertices)
        points = np.concatenate([self.crown, *self.branches, *self.background, *(d.path for d in self.density), *edits])
        if not np.isfinite(points).all():
            raise ValueError("Strokes hold NaN")
        if self.size is not None and not ((points >= 0).all() and (points <= self.size).all()):
            raise ValueError(f"Strokes leave their photo of {self.size[0]} x {self.size[1]} px")

    @property
    def root(self) -> NDArray[np.float64]:
        """Where the tree stands (2,): the first point of the trunk stroke."""
        return np.asarray(self.branches[0][0])


def _frozen_points(path: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (K, 2), read-only."""
    points: NDArray[np.float64] = np.array(path, np.float64)
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"a stroke has shape {points.shape}; expected (K, 2)")
    points.setflags(write=False)
    return points


# The file ------------------------------------------------------------------------------------------

Point = Annotated[list[float], Len(2, 2)]
Pixels = Annotated[int, Gt(0)]


class DensityTable(Table):
    add: bool = Field(description="true for painted foliage, false for a painted hole")
    radius: Annotated[float, Gt(0), Le(1e4)] = Field(description="the brush's radius in pixels, above 0")
    path: Annotated[list[Point], Len(1)] = Field(description="points [x, y] in pixels of the photo")


class SkeletonTable(Table):
    merge: list[Point] = Field(default=[], description="points [x, y] at tips that are no branch's")
    vertices: list[Point] = Field(default=[], description="points [x, y] on the wood's outline where a branch ends")


class StrokeTable(Table):
    """A stroke set as it stands in its file."""

    version: Annotated[int, Ge(VERSION), Le(VERSION)] = Field(description="1, the only version there is so far")
    photo: str = Field(default="", description="the photo's path, in quotes")
    size: Annotated[list[Pixels], Len(2, 2)] = Field(
        description="the photo's [width, height] in whole pixels, such as [1500, 1125]"
    )
    crown: list[Point] = Field(description="one outline of at least 3 points [x, y] in pixels of the photo")
    branches: list[list[Point]] = Field(description="a list of lines, the trunk first, each a list of points [x, y]")
    background: list[list[Point]] = Field(default=[], description="a list of lines, each a list of points [x, y]")
    density: list[DensityTable] = Field(default=[], description="a list of tables with the keys add, radius and path")
    skeleton: SkeletonTable = Field(
        default_factory=SkeletonTable, description="a table with the keys merge and vertices, each a list of points"
    )


def load_strokes(path: Path, photo_size: tuple[int, int] | None = None, *, tree: int | None = None) -> Strokes:
    """Read a stroke set, and compare its size with the photo's (width, height) where that is given.

    Also reads labelme JSON, COCO polygons and SVG, see `stroke_import`; of several trees in such a
    file `tree` chooses one, counted from 1. Points that are clicked twice are dropped, points up to
    2 % outside the photo moved to its edge.

    Raises:
        InputError: the file is missing or broken, or its strokes cannot be used.
    """
    path = Path(path)
    table = checked(StrokeTable, read_stroke_set(path, photo_size, tree), str(path))
    return strokes_from(table, str(path), photo_size)


def strokes_from(table: StrokeTable, where: str, photo_size: tuple[int, int] | None = None) -> Strokes:
    """The strokes of a table that was read from `where`, checked.

    Raises:
        InputError: the strokes cannot be used.
    """
    size = (table.size[0], table.size[1])
    _check_size(size, photo_size, where)
    crown = _inside(table.crown, size, f"{where}: crown")
    if len(crown) > 1 and np.array_equal(crown[0], crown[-1]):
        crown = crown[:-1]
    if len(crown) < 3:
        raise InputError(
            f"{where}: crown has {_count(len(crown), 'different point')}; a crown stroke needs at least 3"
            " to enclose a region; draw it around the whole crown"
        )
    if not table.branches:
        raise InputError(f"{where}: branches is empty; draw at least one line up the trunk, from the root")
    strokes = Strokes(
        crown=crown,
        branches=_lines(table.branches, size, f"{where}: branches"),
        background=_lines(table.background, size, f"{where}: background"),
        density=tuple(
            DensityStroke(one.add, one.radius, _inside(one.path, size, f"{where}: density[{k}].path"))
            for k, one in enumerate(table.density, 1)
        ),
        skeleton=SkeletonEdits(
            merge=_inside(table.skeleton.merge, size, f"{where}: skeleton.merge"),
            vertices=_inside(table.skeleton.vertices, size, f"{where}: skeleton.vertices"),
        ),
        size=size,
        photo=table.photo,
    )
    if not fill_outline(crown, size).any():
        raise InputError(f"{where}: crown encloses no area; draw it around the whole crown")
    _check_trunk(strokes, where)
    return strokes


def save_strokes(strokes: Strokes, path: Path) -> None:
    """Write a stroke set, one stroke a line."""
    if strokes.size is None:
        raise ValueError("save_strokes: Strokes.size is not known")
    entries: dict[str, Any] = {
        "version": VERSION,
        "photo": strokes.photo,
        "size": [int(side) for side in strokes.size],
        "crown": strokes.crown.tolist(),
        "branches": [line.tolist() for line in strokes.branches],
        "background": [line.tolist() for line in strokes.background],
        "density": [{"add": d.add, "radius": d.radius_px, "path": d.path.tolist()} for d in strokes.density],
        "skeleton": {
            key: getattr(strokes.skeleton, key).tolist()
            for key in ("merge", "vertices")
            if len(getattr(strokes.skeleton, key))
        },
    }
    lines = [f"{json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}" for key, value in entries.items() if value]
    Path(path).write_text("{" + ",\n ".join(lines) + "}\n", encoding="utf-8")


def _check_size(size: tuple[int, int], photo_size: tuple[int, int] | None, where: str) -> None:
    if size[0] * size[1] > MAX_PIXELS:
        raise InputError(
            f"{where}: size: expected at most {MAX_PIXELS // 10**6} million pixels, came {size[0]} x {size[1]}"
        )
    if photo_size is None or size == tuple(photo_size):
        return
    if size == tuple(photo_size)[::-1]:
        remedy = "the photo was turned since the strokes were drawn; turn it back, or draw them again"
    else:
        remedy = "give the photo that the strokes were drawn on, or draw them again"
    raise InputError(
        f"{where}: size: expected the photo's {photo_size[0]} x {photo_size[1]}, came {size[0]} x {size[1]}; {remedy}"
    )


def _lines(lines: Sequence[Sequence[Sequence[float]]], size: tuple[int, int], where: str) -> tuple[Any, ...]:
    """Polylines of at least two different points each."""
    found = []
    for k, line in enumerate(lines, 1):
        path = _inside(line, size, f"{where}[{k}]")
        if len(path) < 2:
            raise InputError(
                f"{where}[{k}] has {_count(len(path), 'different point')}; a line needs 2; draw it or delete it"
            )
        found.append(path)
    return tuple(found)


def _inside(points: Sequence[Sequence[float]], size: tuple[int, int], where: str) -> NDArray[np.float64]:
    """Points (K, 2) drawn back to the photo's edge where they overshoot it a little; none twice in a row."""
    xy = np.array(points, np.float64).reshape(-1, 2)
    far = np.maximum(-xy, xy - size).max(axis=1) > OVERSHOOT * max(size)
    if far.any():
        k = int(np.argmax(far))
        raise InputError(
            f"{where}[{k + 1}]: expected a point inside the photo of {size[0]} x {size[1]} px,"
            f" came [{xy[k, 0]:g}, {xy[k, 1]:g}]; draw the stroke again on this photo"
        )
    xy = np.clip(xy, 0, np.nextafter(np.array(size, np.float64), 0))  # so that floor() is a pixel
    return xy[np.append(True, (np.diff(xy, axis=0) != 0).any(axis=1))] if len(xy) else xy


def _check_trunk(strokes: Strokes, where: str) -> None:
    trunk, crown = strokes.branches[0], strokes.crown
    height = float(np.ptp(crown[:, 1]))
    if trunk[0, 1] < trunk[-1, 1]:
        raise InputError(
            f"{where}: branches[1] is the trunk and must be drawn from the root upward, but it ends"
            f" {trunk[-1, 1] - trunk[0, 1]:.0f} px below its beginning; draw it from the ground"
        )
    gap = distance_to_region(trunk, crown)
    if gap > TRUNK_GAP * height:
        raise InputError(
            f"{where}: branches[1], the trunk, ends {gap:.0f} px away from the crown; draw it from the root"
            " up into the crown, or draw the crown around this tree"
        )


def _count(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


# As masks -----------------------------------------------------------------------------------------


def fill_outline(outline: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Pixels (H, W) whose middle a closed outline (K, 2) px runs around.

    What it runs around twice counts too (an outline drawn past its own beginning has no hole
    there), and so do both loops of an eight: the non-zero rule.
    """
    width, height = size
    start, end = outline, np.roll(outline, -1, axis=0)
    # Rows whose middle line y = row + 0.5 an edge crosses: first <= row < last.
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    first = np.clip(np.ceil(low - 0.5), 0, height).astype(np.int64)
    last = np.clip(np.ceil(high - 0.5), 0, height).astype(np.int64)
    edge = np.repeat(np.arange(len(outline)), last - first)
    row = np.arange(len(edge)) - np.repeat(np.cumsum(last - first) - last, last - first)
    rise = end[edge] - start[edge]
    x = start[edge, 0] + (row + 0.5 - start[edge, 1]) / rise[:, 1] * rise[:, 0]
    column = np.clip(np.ceil(x - 0.5), 0, width).astype(np.int64)
    turns = np.zeros((height, width + 1), np.int16)
    np.add.at(turns, (row, column), np.where(rise[:, 1] > 0, 1, -1).astype(np.int16))
    return np.asarray(np.cumsum(turns, axis=1, dtype=np.int16)[:, :width] != 0)


def draw_polyline(path: NDArray[np.float64], size: tuple[int, int], width_px: int = 1) -> NDArray[np.bool_]:
    """Pixels (H, W) under a polyline (K, 2) px."""
    mask = np.zeros(size[::-1], np.uint8)
    cv2.polylines(mask, [np.round(path - 0.5).astype(np.int32)], False, 1, width_px)
    return mask > 0
