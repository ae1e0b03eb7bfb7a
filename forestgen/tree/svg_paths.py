"""SVG as lines: the shapes of a drawing flattened to points, with the names they were given."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forestgen.errors import InputError
from forestgen.reading import MAX_BYTES, one_line, require_file

CURVE_POINTS = 12  # a curve segment becomes this many chords
NUMBER = re.compile(r"[\s,]*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")
FLAG = re.compile(r"[\s,]*([01])")
COMMAND = re.compile(r"[\s,]*([MmZzLlHhVvCcSsQqTtAa])")
TRANSFORM = re.compile(r"([A-Za-z]+)\s*\(([^)]*)\)")
N_ARGUMENTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
NOT_DRAWN = {"defs", "clipPath", "mask", "pattern", "symbol", "marker", "metadata", "style", "script"}
LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"


@dataclass(frozen=True, eq=False)
class SvgShape:
    """One line of a drawing."""

    names: tuple[str, ...]  # label, id and class, its own first, then those of the groups around it
    points: NDArray[np.float64]  # (K, 2) in the drawing's outermost units
    is_closed: bool


@dataclass(frozen=True, eq=False)
class Svg:
    """A drawing: its shapes, and the box (x, y, width, height) that the photo fills."""

    shapes: tuple[SvgShape, ...]
    frame: tuple[float, float, float, float]


def read_svg(path: Path) -> Svg:
    """Read a drawing. The photo's box is that of the <image> in it, else the view box.

    Raises:
        InputError: the file is missing or no SVG, or it says nowhere how large it is.
    """
    require_file(path, "a stroke set (SVG)")
    if path.stat().st_size > MAX_BYTES:
        raise InputError(f"{path}: expected a drawing, but the file is larger than {MAX_BYTES // 10**6} MB")
    try:
        top = ET.fromstring(path.read_bytes())
        if _tag(top) != "svg":
            raise InputError(f"{path}: expected an SVG drawing, came a file of <{one_line(_tag(top))[:40]}>")
        with np.errstate(all="ignore"):  # numbers beyond all bounds become infinite and are refused as points
            elements = list(_drawn(top, (), np.eye(3)))
            shapes = [shape for element, names, matrix in elements for shape in _shapes(element, names, matrix)]
            boxes = [_image_box(element, matrix) for element, _, matrix in elements if _tag(element) == "image"]
        frame = boxes[0] if boxes else _view_box(top)
    except (ET.ParseError, ValueError, LookupError, RecursionError) as error:
        raise InputError(f"{path}: not a valid SVG: {one_line(str(error))[:100]}; export it again") from error
    if frame is None or not (np.isfinite(frame).all() and min(frame[2:]) > 1e-6):
        raise InputError(f"{path}: expected an <image>, a viewBox, or width and height above 0; save it with the photo")
    return Svg(tuple(shapes), frame)


def _drawn(
    element: ET.Element, around: tuple[str, ...], matrix: NDArray[np.float64]
) -> Iterator[tuple[ET.Element, tuple[str, ...], NDArray[np.float64]]]:
    """All visible elements below one, each with its names and its matrix."""
    for child in element:
        style = child.get("style", "").replace(" ", "")
        if _tag(child) in NOT_DRAWN or child.get("display") == "none" or "display:none" in style:
            continue
        own = tuple(name for name in (child.get(LABEL), child.get("id"), child.get("class")) if name)
        placed = matrix @ _transform(child.get("transform", ""))
        yield child, own + around, placed
        yield from _drawn(child, own + around, placed)


def _tag(element: ET.Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _shapes(element: ET.Element, names: tuple[str, ...], matrix: NDArray[np.float64]) -> Iterator[SvgShape]:
    kind = _tag(element)
    if kind == "path":
        lines = path_lines(element.get("d", ""))
    elif kind in ("polyline", "polygon"):
        numbers = [float(n) for n in NUMBER.findall(element.get("points", ""))]
        lines = [(np.array(numbers[: len(numbers) // 2 * 2]).reshape(-1, 2), kind == "polygon")]
    elif kind == "line":
        lines = [(np.array([_lengths(element, "x1", "y1"), _lengths(element, "x2", "y2")]), False)]
    elif kind == "rect":
        (x, y), (w, h) = _lengths(element, "x", "y"), _lengths(element, "width", "height")
        lines = [(np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]]), True)]
    elif kind in ("circle", "ellipse"):
        radius = _lengths(element, "r", "r") if kind == "circle" else _lengths(element, "rx", "ry")
        turn = np.linspace(0, 2 * np.pi, 4 * CURVE_POINTS, endpoint=False)
        ring = np.column_stack([np.cos(turn), np.sin(turn)])
        lines = [(_lengths(element, "cx", "cy") + ring * radius, True)]
    else:
        return
    for points, is_closed in lines:
        if len(points):
            yield SvgShape(names, points @ matrix[:2, :2].T + matrix[:2, 2], is_closed)


def _lengths(element: ET.Element, *keys: str) -> tuple[float, ...]:
    """Numbers of attributes; a unit behind them is passed over, one that is missing is 0."""
    found = [NUMBER.match(element.get(key, "0")) for key in keys]
    return tuple(float(match[1]) if match else 0.0 for match in found)


def _image_box(element: ET.Element, matrix: NDArray[np.float64]) -> tuple[float, float, float, float]:
    (x, y), (w, h) = _lengths(element, "x", "y"), _lengths(element, "width", "height")
    if matrix[0, 1] or matrix[1, 0]:
        raise ValueError("the photo in it is turned or skewed")
    x0, y0, _ = matrix @ [x, y, 1]
    return float(x0), float(y0), float(w * matrix[0, 0]), float(h * matrix[1, 1])


def _view_box(top: ET.Element) -> tuple[float, float, float, float] | None:
    numbers = [float(n) for n in NUMBER.findall(top.get("viewBox", ""))]
    if len(numbers) == 4:
        return numbers[0], numbers[1], numbers[2], numbers[3]
    width, height = _lengths(top, "width", "height")
    return (0.0, 0.0, width, height) if width and height else None


def _transform(text: str) -> NDArray[np.float64]:
    """The matrix (3, 3) of a transform attribute."""
    total = np.eye(3)
    for name, inside in TRANSFORM.findall(text):
        total = total @ _one_transform(name, [float(n) for n in NUMBER.findall(inside)])
    return total


def _one_transform(name: str, n: list[float]) -> NDArray[np.float64]:
    if name == "matrix" and len(n) == 6:
        return np.array([[n[0], n[2], n[4]], [n[1], n[3], n[5]], [0, 0, 1]])
    if name == "translate" and len(n) in (1, 2):
        return np.array([[1, 0, n[0]], [0, 1, n[1] if len(n) > 1 else 0], [0, 0, 1.0]])
    if name == "scale" and len(n) in (1, 2):
        return np.diag([n[0], n[-1], 1])
    if name == "rotate" and len(n) in (1, 3):
        c, s = math.cos(math.radians(n[0])), math.sin(math.radians(n[0]))
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        there = _one_transform("translate", n[1:] or [0.0])
        back = _one_transform("translate", [-v for v in n[1:]] or [0.0])
        return np.asarray(there @ turn @ back)
    if name in ("skewX", "skewY") and len(n) == 1:
        skew = np.eye(3)
        skew[(0, 1) if name == "skewX" else (1, 0)] = math.tan(math.radians(n[0]))
        return skew
    raise ValueError(f"transform {name} with {len(n)} numbers")


def path_lines(d: str) -> list[tuple[NDArray[np.float64], bool]]:
    """The subpaths of a path's `d` as points (K, 2), and whether each is closed."""
    lines: list[tuple[list[complex], bool]] = []
    at = start = control = 0j
    command = previous = ""
    position = 0
    while (match := COMMAND.match(d, position)) or (NUMBER.match(d, position) and command not in ("", "Z", "z")):
        if match:
            command, position = match[1], match.end()
        elif command in "Mm":
            command = "L" if command == "M" else "l"  # more points after a move are lines
        kind = command.upper()
        numbers, position = _arguments(d, position, kind)
        base = at if command.islower() else 0j
        ends = [base + complex(x, y) for x, y in zip(numbers[0::2], numbers[1::2], strict=False)]
        if kind == "Z":
            if lines:
                lines[-1] = (lines[-1][0], True)
            at = start
        elif kind == "M":
            at = start = ends[0]
        else:
            if not lines or lines[-1][1] or previous in ("M", "Z"):
                lines.append(([at], False))
            if kind == "L":
                new = ends
            elif kind == "H":
                new = [complex(base.real + numbers[0], at.imag)]
            elif kind == "V":
                new = [complex(at.real, base.imag + numbers[0])]
            elif kind == "A":
                new = _arc(at, numbers, base + complex(numbers[5], numbers[6]))
            else:
                if kind in "ST":  # the control point is the last one's mirror image
                    ends.insert(0, 2 * at - control if previous in ("CS" if kind == "S" else "QT") and previous else at)
                new, control = _bezier([at, *ends]), ends[-2]
            lines[-1][0].extend(new)
            at = new[-1]
        previous = kind
    if d[position:].strip(" \t\r\n,"):
        raise ValueError(f"path data breaks off at '{d[position : position + 20]}'")
    return [(np.array([[p.real, p.imag] for p in points]), is_closed) for points, is_closed in lines]


def _arguments(d: str, position: int, kind: str) -> tuple[list[float], int]:
    numbers = []
    for k in range(N_ARGUMENTS[kind]):
        match = (FLAG if kind == "A" and k in (3, 4) else NUMBER).match(d, position)
        if not match:
            raise ValueError(f"path command {kind} lacks numbers at '{d[position : position + 20]}'")
        numbers.append(float(match[1]))
        position = match.end()
    return numbers, position


def _bezier(knots: list[complex]) -> list[complex]:
    """Points along a quadratic or cubic curve, its first left out."""
    degree = len(knots) - 1
    t = np.arange(1, CURVE_POINTS + 1) / CURVE_POINTS
    total = sum(math.comb(degree, k) * t**k * (1 - t) ** (degree - k) * knot for k, knot in enumerate(knots))
    return [complex(p) for p in np.asarray(total)]


def _arc(start: complex, numbers: list[float], end: complex) -> list[complex]:
    """Points along an elliptical arc, its first left out (SVG 1.1, appendix F.6)."""
    rx, ry, is_large, is_sweep = abs(numbers[0]), abs(numbers[1]), numbers[3], numbers[4]
    if rx == 0 or ry == 0 or start == end:
        return [end]
    turn = np.exp(1j * math.radians(numbers[2]))
    half = (start - end) / 2 / turn
    unit = complex(half.real / rx, half.imag / ry)  # on the unit circle from here on
    reach = max(1.0, abs(unit))
    unit /= reach
    side = math.sqrt(max(0.0, 1 / abs(unit) ** 2 - 1)) * (-1 if is_large == is_sweep else 1)
    centre = complex(unit.imag, -unit.real) * side
    first, last = np.angle(unit - centre), np.angle(-unit - centre)
    sweep = (last - first) % (2 * np.pi) if is_sweep else -((first - last) % (2 * np.pi))
    angle = first + sweep * np.arange(1, CURVE_POINTS + 1) / CURVE_POINTS
    ring = (np.exp(1j * angle) + centre) * reach
    return [*((ring.real * rx + 1j * ring.imag * ry) * turn + (start + end) / 2)[:-1].tolist(), end]
