"""Strokes drawn in labelme, COCO tools and SVG editors become the same stroke set."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from forestgen.errors import InputError
from forestgen.tree.stroke_import import kind_of
from forestgen.tree.strokes import load_strokes, save_strokes
from forestgen.tree.svg_paths import path_lines

SIZE = (100, 80)
CROWN = [[30.0, 10.0], [70.0, 10.0], [70.0, 50.0], [30.0, 50.0]]
TRUNK = [[50.0, 75.0], [50.0, 30.0]]
BRANCH = [[50.0, 45.0], [62.0, 20.0]]
STEM = [[48.0, 75.0], [52.0, 75.0], [52.0, 30.0], [48.0, 30.0]]  # the trunk as an outline


def shape(label: str, points: Any, kind: str = "linestrip", group: int | None = None) -> dict[str, Any]:
    return {"label": label, "points": points, "shape_type": kind, "group_id": group, "flags": {}}


def labelme(*shapes: dict[str, Any]) -> dict[str, Any]:
    sizes = {"imageHeight": SIZE[1], "imageWidth": SIZE[0]}
    return {"version": "5.4.1", "flags": {}, "shapes": list(shapes), "imagePath": "a.jpg", "imageData": None} | sizes


def coco(*annotations: tuple[str, Any]) -> dict[str, Any]:
    names = ["tree", "crown", "Trunk", "branch", "background"]
    return {
        "info": {},
        "images": [{"id": 7, "width": SIZE[0], "height": SIZE[1], "file_name": "a.jpg"}],
        "categories": [{"id": k, "name": name, "supercategory": ""} for k, name in enumerate(names)],
        "annotations": [
            {"id": k, "image_id": 7, "category_id": names.index(name), "segmentation": polygons, "iscrowd": 0}
            for k, (name, polygons) in enumerate(annotations)
        ],
    }


def svg(body: str, head: str = 'viewBox="0 0 100 80"') -> str:
    space = 'xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
    return f'<?xml version="1.0"?><svg {space} {head}>{body}</svg>'


def written(folder: Path, content: Any, name: str = "a.json") -> Path:
    (folder / name).write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return folder / name


def flat(points: list[list[float]]) -> list[float]:
    return [number for point in points for number in point]


@pytest.mark.parametrize(
    ("name", "kind"),
    [("crown", "crown"), ("Crown 2", "crown"), ("TRUNK_left", "trunk"), ("branch-3", "branch"), ("Branches", "branch"),
     (" background", "background"), ("crowned", None), ("path12", None), ("", None)],
)  # fmt: skip
def test_a_name_begins_with_what_it_is(name: str, kind: str | None) -> None:
    assert kind_of([name]) == kind


def test_labelme(tmp_path: Path) -> None:
    content = labelme(
        shape("sky", [[0, 0], [9, 9], [0, 9]], "polygon"),
        shape("branch 1", BRANCH[::-1]),  # drawn toward the trunk
        shape("Crown", CROWN, "polygon"),
        shape("trunk", TRUNK[::-1], "line"),  # drawn downward
        shape("background", [[5, 5], [5, 70]]),
    )
    strokes = load_strokes(written(tmp_path, content), SIZE)
    assert strokes.crown.tolist() == CROWN
    assert [line.tolist() for line in strokes.branches] == [TRUNK, BRANCH]
    assert strokes.background[0].tolist() == [[5, 5], [5, 70]]
    assert (strokes.photo, strokes.size) == ("a.jpg", SIZE)


def test_labelme_rectangle_and_circle_as_crowns(tmp_path: Path) -> None:
    box = labelme(shape("crown", [CROWN[0], CROWN[2]], "rectangle"), shape("trunk", TRUNK))
    assert load_strokes(written(tmp_path, box)).crown.tolist() == CROWN
    ring = labelme(shape("crown", [[50, 30], [50, 50]], "circle"), shape("trunk", TRUNK))
    crown = load_strokes(written(tmp_path, ring)).crown
    assert_allclose(np.linalg.norm(crown - [50, 30], axis=1), 20)


def test_coco_outlined_trunk_becomes_the_line_up_its_middle(tmp_path: Path) -> None:
    twig = [[50.0, 44.0], [50.0, 46.0], [66.0, 46.0], [66.0, 44.0]]
    content = coco(
        ("crown", [flat(CROWN)]), ("branch", [flat(twig)]), ("Trunk", [flat(STEM)]), ("tree", [[0, 0, 1, 1, 2, 2]])
    )
    strokes = load_strokes(written(tmp_path, content), SIZE)
    assert strokes.crown.tolist() == CROWN
    trunk, branch = strokes.branches
    assert_allclose(trunk[:, 0], 50)
    assert trunk[0, 1] == pytest.approx(75, abs=1)
    assert trunk[-1, 1] == pytest.approx(30, abs=1)
    assert (np.diff(trunk[:, 1]) < 0).all()
    assert_allclose(branch[:, 1], 45, atol=1)
    assert branch[0, 0] < 52 < 64 < branch[-1, 0]


def test_a_bent_outline_keeps_its_bend(tmp_path: Path) -> None:
    rows = np.linspace(30, 75, 20)
    bend = 50 + 8 * np.sin((rows - 30) / 45 * np.pi)
    outline = np.concatenate([np.column_stack([bend - 2, rows]), np.column_stack([bend + 2, rows])[::-1]])
    content = labelme(shape("crown", CROWN, "polygon"), shape("trunk", outline.tolist(), "polygon"))
    trunk = load_strokes(written(tmp_path, content)).branches[0]
    assert_allclose(trunk[:, 0], np.interp(trunk[:, 1], rows, bend), atol=0.05)


BODY = """
<g id="layer1" inkscape:label="Layer 1">
  <image x="10" y="20" width="50" height="40" href="a.jpg"/>
  <g transform="translate(10 20) scale(0.5)">
    <path inkscape:label="crown" d="M30 10h40v40H30z"/>
    <g id="trunk"><polyline points="50,75 50,30"/></g>
    <line class="branch" x1="50" y1="45" x2="62" y2="20"/>
    <path id="path9" d="M0 0L1 1"/>
    <path id="branch-hidden" style="fill:none; display: none" d="M0 0L1 1"/>
  </g>
</g>
"""


def test_svg_is_scaled_by_the_picture_in_it(tmp_path: Path) -> None:
    strokes = load_strokes(written(tmp_path, svg(BODY, 'viewBox="0 0 200 200"'), "a.svg"), SIZE)
    assert_allclose(strokes.crown, CROWN)
    assert_allclose(strokes.branches[0], TRUNK)
    assert_allclose(strokes.branches[1], BRANCH)
    assert len(strokes.branches) == 2
    large = load_strokes(tmp_path / "a.svg", (1000, 800))
    assert_allclose(large.crown, np.array(CROWN) * 10)


def test_svg_without_a_picture_fills_its_view_box(tmp_path: Path) -> None:
    body = '<polygon id="crown" points="30,10 70,10 70,50 30,50"/><path id="trunk" d="M50,75V30"/>'
    for head in ('viewBox="0 0 100 80"', 'width="100px" height="80"'):
        strokes = load_strokes(written(tmp_path, svg(body, head), "a.svg"))
        assert_allclose(strokes.crown, CROWN)
        assert strokes.size == SIZE


def test_svg_circle_and_rotation(tmp_path: Path) -> None:
    body = (
        '<ellipse id="crown" cx="50" cy="30" rx="20" ry="15"/>'
        '<line id="trunk" transform="rotate(90 50 40)" x1="15" y1="40" x2="60" y2="40"/>'
    )
    strokes = load_strokes(written(tmp_path, svg(body), "a.svg"))
    assert_allclose((((strokes.crown - [50, 30]) / [20, 15]) ** 2).sum(axis=1), 1)
    assert_allclose(strokes.branches[0], [[50, 50], [50, 5]])  # turned upright, and begun at its lower end


def test_path_data() -> None:
    (line, is_closed), (second, _) = path_lines("m1-1 2,0.5.5.5z M5 5 6 6")
    assert line.tolist() == [[1, -1], [3, -0.5], [3.5, 0]]
    assert is_closed
    assert second.tolist() == [[5, 5], [6, 6]]


def test_path_curves_end_where_they_should_and_lie_on_the_curve() -> None:
    cubic = path_lines("M0 0C0 4 4 4 4 0S8-4 8 0")[0][0]
    assert cubic[12].tolist() == [4, 0]
    assert cubic[24].tolist() == [8, 0]
    assert_allclose(cubic[6], [2, 3])  # the curve's middle, by de Casteljau
    assert_allclose(cubic[18], [6, -3])  # its mirror image: S continued it smoothly
    quadratic = path_lines("M0 0q2 4 4 0t4 0")[0][0]
    assert_allclose(quadratic[6], [2, 2])
    assert_allclose(quadratic[18], [6, -2])


@pytest.mark.parametrize(
    ("flags", "middle"), [("0 1", [5, -5]), ("0 0", [5, 5]), ("01", [5, -5])]
)  # sweep 1 turns clockwise on a screen whose y points down
def test_half_circle(flags: str, middle: list[float]) -> None:
    arc = path_lines(f"M0 0A5 5 0 {flags} 10 0")[0][0]
    assert_allclose(np.linalg.norm(arc - [5, 0], axis=1), 5)
    assert_allclose(arc[6], middle, atol=1e-9)
    assert arc[-1].tolist() == [10, 0]


def test_arc_large_and_small() -> None:
    # Both circles of radius 5 through (0,0) and (6,0) have their centres at (3, +-4).
    small = path_lines("M0 0A5 5 0 0 1 6 0")[0][0]
    large = path_lines("M0 0A5 5 0 1 1 6 0")[0][0]
    assert_allclose(small[6], [3, -1], atol=1e-9)
    assert_allclose(large[6], [3, -9], atol=1e-9)


def test_of_several_trees_in_a_file_one_is_chosen(tmp_path: Path) -> None:
    shift = np.array([100.0, 0])
    other = [(np.array(points) + shift).tolist() for points in (CROWN, TRUNK)]
    content = labelme(
        shape("crown", CROWN, "polygon"),
        shape("trunk", other[1]),
        shape("crown", other[0], "polygon"),
        shape("trunk", TRUNK),
    )
    content["imageWidth"] = 200
    path = written(tmp_path, content)
    with pytest.raises(InputError, match="expected one shape named 'crown', came 2; keep one tree a file"):
        load_strokes(path)
    assert load_strokes(path, tree=1).root.tolist() == TRUNK[0]  # strokes go to the nearest crown
    assert load_strokes(path, tree=2).root.tolist() == other[1][0]
    with pytest.raises(InputError, match="expected a tree from 1 to 2, came 3"):
        load_strokes(path, tree=3)


def test_groups_outweigh_nearness(tmp_path: Path) -> None:
    far = (np.array(CROWN) + np.array([20.0, 0])).tolist()
    content = labelme(
        shape("crown", CROWN, "polygon", 1), shape("crown", far, "polygon", 2), shape("trunk", TRUNK, group=2)
    )
    path = written(tmp_path, content)
    assert load_strokes(path, tree=2).root.tolist() == TRUNK[0]
    with pytest.raises(InputError, match="expected a shape named 'trunk', came none"):
        load_strokes(path, tree=1)


def test_what_is_imported_can_be_saved_and_read_as_our_own(tmp_path: Path) -> None:
    strokes = load_strokes(written(tmp_path, svg(BODY), "a.svg"), SIZE)
    save_strokes(strokes, tmp_path / "own.json")
    assert_allclose(load_strokes(tmp_path / "own.json", SIZE).crown, CROWN)


REFUSED: dict[str, tuple[str, Any, str]] = {
    "no crown": ("a.json", labelme(shape("oak", CROWN, "polygon")), "expected a shape named 'crown', came oak; name"),
    "no trunk": ("a.json", labelme(shape("crown", CROWN, "polygon")), "expected a shape named 'trunk', came none"),
    "mask": ("a.json", labelme(shape("crown", CROWN, "mask")), r"shapes\[1\] 'crown': expected a polygon, .* 'mask'"),
    "no size": ("a.json", {"shapes": []}, "imageWidth is missing: expected the photo's width"),
    "odd point": ("a.json", labelme(shape("crown", [[1, 2, 3]], "polygon")), r"'crown': expected points of two"),
    "bitmap": (
        "a.json",
        coco(("crown", {"counts": [], "size": [1, 1]})),
        r"annotations\[1\]: segmentation: expected poly",
    ),
    "no image": ("a.json", coco(), "expected one image with annotations .* came no image"),
    "odd count": ("a.json", coco(("crown", [[1, 2, 3]])), r"annotations\[1\]\.segmentation: expected points of two"),
    "no xml": ("a.svg", "{}", r"a\.svg: not a valid SVG: .*; export it again"),
    "html": ("a.svg", "<html/>", "expected an SVG drawing, came a file of <html>"),
    "no frame": ("a.svg", svg("", ""), "expected an <image>, a viewBox, or width and height"),
    "bad path": ("a.svg", svg('<path id="crown" d="M1 2L3"/>'), "path command L lacks numbers"),
    "bad matrix": ("a.svg", svg('<g transform="matrix(1 2)"/>'), "transform matrix with 2 numbers"),
    "turned": ("a.svg", svg('<image width="9" height="9" transform="rotate(5)"/>'), "the photo in it is turned"),
    "vast": ("a.svg", svg('<path id="crown" d="M1e999 2L3 4z"/>'), "came one far from it"),
    "empty": ("a.svg", "", "the file is empty"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_imported_is_said_in_one_line(tmp_path: Path, name: str) -> None:
    file, content, message = REFUSED[name]
    with pytest.raises(InputError, match=message) as caught:
        load_strokes(written(tmp_path, content, file))
    assert str(caught.value).startswith(str(tmp_path / file))
    assert "\n" not in str(caught.value)


def test_svg_of_another_shape_than_the_photo(tmp_path: Path) -> None:
    path = written(tmp_path, svg(BODY), "a.svg")
    with pytest.raises(InputError, match="expected a picture of the photo's shape, 80 x 100, came 50 x 40; draw"):
        load_strokes(path, (80, 100))


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text("MmLlHhVvCcSsQqTtAaZz0123456789.,-+eE ", max_size=60))
def test_any_path_data_gives_lines_or_a_value_error(d: str) -> None:
    try:
        lines = path_lines(d)
    except ValueError:
        return
    assert all(points.ndim == 2 for points, _ in lines)


def test_mutated_files_give_strokes_or_an_input_error(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    wholes = {
        "a.svg": svg(BODY, 'viewBox="0 0 200 200"'),
        "a.json": json.dumps(labelme(shape("crown", CROWN, "polygon"), shape("trunk", STEM, "polygon"))),
        "b.json": json.dumps(coco(("crown", [flat(CROWN)]), ("Trunk", [flat(STEM)]))),
    }
    pieces = ["1e999", "-1", "0", "null", '"x"', "[]", "{}", "true", "<", ">", "NaN", "9" * 30, "e", " "]
    for name, whole in wholes.items():
        for _ in range(150):
            text = whole
            for _ in range(rng.integers(1, 4)):
                at = int(rng.integers(len(text)))
                text = text[:at] + pieces[rng.integers(len(pieces))] + text[at + int(rng.integers(0, 6)) :]
            try:
                strokes = load_strokes(written(tmp_path, text, name))
            except InputError as error:
                message = str(error)
            else:
                message = ""
                assert len(strokes.crown) >= 3
            assert "\n" not in message
