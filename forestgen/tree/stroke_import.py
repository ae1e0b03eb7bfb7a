"""Stroke sets drawn elsewhere: labelme JSON, COCO polygons and SVG, brought into our own format.

A shape says by its name what it is: `crown`, `trunk`, `branch` or `background`, in any case, with
anything behind it (`Branch 2`). In COCO the category's name counts, in SVG the label, id or class of
the shape or of a group around it. Other shapes are passed over.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from forestgen.errors import InputError
from forestgen.reading import Table, checked, one_line, quoted, read_json, shortened
from forestgen.tree.outline import distance_to_region
from forestgen.tree.svg_paths import read_svg

KINDS = {
    "crown": "crown", "canopy": "crown", "foliage": "crown",
    "trunk": "trunk", "stem": "trunk",
    "branch": "branch", "branches": "branch", "limb": "branch",
    "background": "background",
}  # fmt: skip
CENTRE_POINTS = 12  # points of the line that is drawn up the middle of an outlined trunk or branch
FAR_PX = 1e7  # no photo reaches so far
ASPECT = 0.02  # by how much a drawing's picture may differ from the photo in shape


@dataclass(frozen=True, eq=False)
class Drawn:
    """A named shape in pixels of the photo."""

    kind: str  # a value of KINDS
    group: str  # what the drawing tool put together; empty where it did not
    points: NDArray[np.float64]  # (K, 2) px
    is_closed: bool


def read_stroke_set(path: Path, photo_size: tuple[int, int] | None = None, tree: int | None = None) -> Any:
    """The content of a stroke set in our own format, whichever of the known formats the file has.

    `photo_size` (width, height) scales an SVG. `tree` chooses one crown of several, counted from 1 in
    the order of the file.

    Raises:
        InputError: the file is missing or broken, or lacks a crown or a trunk.
    """
    if path.suffix.lower() in (".svg", ".xml"):
        return _from_svg(path, photo_size, tree)
    data = read_json(path, "a stroke set (JSON)")
    if isinstance(data, dict) and "shapes" in data:
        return _from_labelme(data, str(path), tree)
    if isinstance(data, dict) and "annotations" in data:
        return _from_coco(data, str(path), photo_size, tree)
    return data


# labelme -------------------------------------------------------------------------------------------


class LabelmeShape(Table, extra="ignore"):
    label: str = Field(description="the shape's name in quotes")
    points: list[list[float]] = Field(description="points [x, y]")
    group_id: int | str | None = Field(default=None, description="a whole number")
    shape_type: str = Field(default="polygon", description="polygon, linestrip, line, rectangle or circle")


class LabelmeFile(Table, extra="ignore"):
    shapes: list[LabelmeShape] = Field(description="a list of shapes")
    imagePath: str | None = Field(default=None, description="the photo's path")  # noqa: N815 - labelme's word
    imageWidth: int = Field(description="the photo's width in pixels")  # noqa: N815
    imageHeight: int = Field(description="the photo's height in pixels")  # noqa: N815


def _from_labelme(data: Any, where: str, tree: int | None) -> dict[str, Any]:
    file = checked(LabelmeFile, data, where)
    drawn = []
    for k, shape in enumerate(file.shapes, 1):
        if (kind := kind_of([shape.label])) is None:
            continue
        points = _points(shape.points, f"{where}: shapes[{k}] {quoted(shape.label)}")
        if shape.shape_type == "rectangle" and len(points) == 2:
            (x0, y0), (x1, y1) = points
            points = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        elif shape.shape_type == "circle" and len(points) == 2:
            turn = np.linspace(0, 2 * np.pi, 48, endpoint=False)
            reach = np.linalg.norm(points[1] - points[0])
            points = points[0] + reach * np.column_stack([np.cos(turn), np.sin(turn)])
        elif shape.shape_type not in ("polygon", "linestrip", "line"):
            raise InputError(
                f"{where}: shapes[{k}] {quoted(shape.label)}: expected a polygon, linestrip, line, rectangle or"
                f" circle, came {quoted(shape.shape_type)}; draw it as one of these"
            )
        is_closed = shape.shape_type not in ("linestrip", "line")
        drawn.append(Drawn(kind, "" if shape.group_id is None else str(shape.group_id), points, is_closed))
    labels = [shape.label for shape in file.shapes]
    return assembled(drawn, (file.imageWidth, file.imageHeight), file.imagePath or "", where, labels, tree)


# COCO ----------------------------------------------------------------------------------------------


class CocoImage(Table, extra="ignore"):
    id: int | str = Field(description="the image's number")
    width: int = Field(description="the photo's width in pixels")
    height: int = Field(description="the photo's height in pixels")
    file_name: str = Field(default="", description="the photo's name")


class CocoCategory(Table, extra="ignore"):
    id: int | str = Field(description="the category's number")
    name: str = Field(description="the category's name")


class CocoAnnotation(Table, extra="ignore"):
    image_id: int | str = Field(description="an image's number")
    category_id: int | str = Field(description="a category's number")
    segmentation: Any = Field(default=None, description="a list of polygons [x, y, x, y, ...]")


class CocoFile(Table, extra="ignore"):
    images: list[CocoImage] = Field(description="a list of images")
    categories: list[CocoCategory] = Field(description="a list of categories")
    annotations: list[CocoAnnotation] = Field(description="a list of annotations")


class CocoPolygons(Table):
    segmentation: list[list[float]] = Field(description="polygons [x, y, x, y, ...]; draw polygons, not bitmaps")


def _from_coco(data: Any, where: str, photo_size: tuple[int, int] | None, tree: int | None) -> dict[str, Any]:
    file = checked(CocoFile, data, where)
    names = {category.id: category.name for category in file.categories}
    kinds = {key: kind for key, name in names.items() if (kind := kind_of([name]))}
    image = _coco_image(file, kinds, where, photo_size)
    drawn = []
    for k, one in enumerate(file.annotations, 1):
        if one.image_id != image.id or one.category_id not in kinds:
            continue
        place = f"{where}: annotations[{k}]"
        for flat in checked(CocoPolygons, {"segmentation": one.segmentation}, place).segmentation:
            pairs = [flat[i : i + 2] for i in range(0, len(flat), 2)]
            drawn.append(Drawn(kinds[one.category_id], "", _points(pairs, f"{place}.segmentation"), True))
    return assembled(drawn, (image.width, image.height), image.file_name, where, names.values(), tree)


def _coco_image(
    file: CocoFile, kinds: Mapping[int | str, str], where: str, photo_size: tuple[int, int] | None
) -> CocoImage:
    """The one image that the strokes are on; of several the one of the photo's size."""
    used = {one.image_id for one in file.annotations if one.category_id in kinds}
    images = [image for image in file.images if image.id in used]
    if len(images) > 1 and photo_size:
        images = [image for image in images if (image.width, image.height) == tuple(photo_size)]
    if len(images) != 1:
        came = "no image" if not images else f"{len(images)} images"
        raise InputError(
            f"{where}: expected one image with annotations of the categories crown and trunk, came {came};"
            " export the annotations of this photo alone"
        )
    return images[0]


# SVG -----------------------------------------------------------------------------------------------


def _from_svg(path: Path, photo_size: tuple[int, int] | None, tree: int | None) -> dict[str, Any]:
    svg = read_svg(path)
    x, y, width, height = svg.frame
    if photo_size is None:
        photo_size = (max(1, round(width)), max(1, round(height)))
    if abs(width * photo_size[1] / (height * photo_size[0]) - 1) > ASPECT:
        raise InputError(
            f"{path}: expected a picture of the photo's shape, {photo_size[0]} x {photo_size[1]}, came"
            f" {width:g} x {height:g}; draw over this photo, and let it fill the page"
        )
    drawn = []
    for shape in svg.shapes:
        if kind := kind_of(shape.names):
            with np.errstate(all="ignore"):  # infinite points are refused below
                points = (shape.points - [x, y]) * [photo_size[0] / width, photo_size[1] / height]
            group = next((name for name in shape.names if kind_of([name]) is None), "")
            is_outline = kind == "crown" or shape.is_closed
            drawn.append(Drawn(kind, group, _points(points.tolist(), str(path)), is_outline))
    labels = [shape.names[0] for shape in svg.shapes if shape.names]
    return assembled(drawn, photo_size, "", str(path), labels, tree)


# All -----------------------------------------------------------------------------------------------


def kind_of(names: Iterable[str]) -> str | None:
    """What a shape is, by the first of its names that begins with a known word."""
    words = (re.match(r"[a-z]*", name.strip().lower()) for name in names)
    return next((KINDS[word[0]] for word in words if word and word[0] in KINDS), None)


def assembled(
    drawn: Sequence[Drawn],
    size: tuple[int, int],
    photo: str,
    where: str,
    labels: Iterable[str],
    tree: int | None = None,
) -> dict[str, Any]:
    """A stroke set in our own format from shapes drawn elsewhere.

    A shape belongs to the crown of its group, else to the nearest one; background belongs to all. An
    outlined trunk or branch becomes the line up its middle. Lines are turned to begin at their foot.

    Raises:
        InputError: there is no crown, no trunk, or several crowns and no `tree` to choose by.
    """
    crowns = [one for one in drawn if one.kind == "crown"]
    if not crowns:
        came = shortened(one_line(", ".join(dict.fromkeys(labels))) or "no named shape", 100)
        raise InputError(f"{where}: expected a shape named 'crown', came {came}; name the crown's outline so")
    if tree is None and len(crowns) > 1:
        raise InputError(f"{where}: expected one shape named 'crown', came {len(crowns)}; keep one tree a file")
    if tree is not None and not 1 <= tree <= len(crowns):
        raise InputError(f"{where}: expected a tree from 1 to {len(crowns)}, came {tree}")
    crown = crowns[(tree or 1) - 1]
    own = [one for one in drawn if one.kind in ("trunk", "branch") and _crown_of(one, crowns) is crown]
    lines = [(one.kind, _middle(one.points, one.kind) if one.is_closed else one.points) for one in own]
    lines = [(kind, line) for kind, line in lines if len(line)]
    if not lines:
        raise InputError(f"{where}: expected a shape named 'trunk', came none; draw a line up the trunk and name it so")
    # The trunk is the first so named; of branches alone, the one that reaches lowest.
    named = [k for k, (kind, _) in enumerate(lines) if kind == "trunk"]
    lowest = max(range(len(lines)), key=lambda k: float(lines[k][1][:, 1].max()))
    _, trunk = lines.pop(named[0] if named else lowest)
    trunk = trunk if trunk[0, 1] >= trunk[-1, 1] else trunk[::-1]
    branches = [trunk, *(_from_trunk(line, trunk) for _, line in lines)]
    return {
        "version": 1,
        "photo": photo,
        "size": list(size),
        "crown": crown.points.tolist(),
        "branches": [line.tolist() for line in branches],
        "background": [one.points.tolist() for one in drawn if one.kind == "background" and len(one.points) > 1],
    }


def _crown_of(one: Drawn, crowns: Sequence[Drawn]) -> Drawn:
    same = [crown for crown in crowns if one.group and crown.group == one.group] or list(crowns)
    if len(same) == 1 or not len(one.points):
        return same[0]
    return min(same, key=lambda crown: distance_to_region(one.points, crown.points))


def _from_trunk(line: NDArray[np.float64], trunk: NDArray[np.float64]) -> NDArray[np.float64]:
    """A branch line, begun at the end that is nearer to the trunk."""
    near = [np.linalg.norm(trunk - end, axis=1).min() for end in (line[0], line[-1])]
    return line if near[0] <= near[1] else line[::-1]


def _middle(outline: NDArray[np.float64], kind: str) -> NDArray[np.float64]:
    """The line (K, 2) up the middle of a long outline: of a trunk upward, else along its longest way."""
    along = np.array([0.0, -1.0]) if kind == "trunk" else _longest_way(outline)
    across = np.array([-along[1], along[0]])
    s, t = outline @ along, outline @ across
    s1, t1 = np.roll(s, -1), np.roll(t, -1)
    line = []
    for level in s.min() + np.ptp(s) * np.linspace(0.01, 0.99, CENTRE_POINTS):
        is_cut = (s <= level) != (s1 <= level)
        cut = t[is_cut] + (level - s[is_cut]) / (s1 - s)[is_cut] * (t1 - t)[is_cut]
        if len(cut):
            line.append(along * level + across * (cut.min() + cut.max()) / 2)
    return np.array(line).reshape(-1, 2)


def _longest_way(outline: NDArray[np.float64]) -> NDArray[np.float64]:
    """The unit direction between the two vertices that are farthest from each other."""
    some = outline[:: max(1, len(outline) // 200)]
    away = some[:, None] - some[None]
    far = away.reshape(-1, 2)[np.argmax((away**2).sum(axis=-1))]
    length = np.linalg.norm(far)
    return far / length if length > 0 else np.array([0.0, -1.0])


def _points(points: Sequence[Sequence[float]], where: str) -> NDArray[np.float64]:
    """Points (K, 2), finite."""
    if any(len(point) != 2 for point in points):
        raise InputError(f"{where}: expected points of two numbers each; draw the shape again")
    xy = np.array(points, np.float64).reshape(-1, 2)
    if not (np.abs(xy) < FAR_PX).all():
        raise InputError(f"{where}: expected points inside the photo, came one far from it; draw the shape again")
    return xy
