"""Stroke sets: what a person may draw, what is mended in silence, and what is sent back with a remedy."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.errors import InputError
from forestgen.tree.outline import distance_to_region, winding_number
from forestgen.tree.strokes import Strokes, draw_polyline, fill_outline, load_strokes, save_strokes

SIZE = (100, 80)


def stroke_set(**changes: Any) -> dict[str, Any]:
    """A crown on a trunk in a photo of 100 x 80 px."""
    whole = {
        "version": 1,
        "photo": "oak.jpg",
        "size": list(SIZE),
        "crown": [[30, 10], [70, 10], [70, 50], [30, 50]],
        "branches": [[[50, 75], [50, 30]], [[50, 45], [62, 20]]],
        "background": [[[5, 5], [5, 70]]],
        "density": [{"add": False, "radius": 4.5, "path": [[50, 20], [55, 20]]}],
    }
    return {key: value for key, value in (whole | changes).items() if value is not None}


def written(folder: Path, content: Any) -> Path:
    path = folder / "oak.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def test_a_whole_stroke_set(tmp_path: Path) -> None:
    strokes = load_strokes(written(tmp_path, stroke_set()), SIZE)
    assert_array_equal(strokes.crown, [[30, 10], [70, 10], [70, 50], [30, 50]])
    assert [path.tolist() for path in strokes.branches] == [[[50, 75], [50, 30]], [[50, 45], [62, 20]]]
    assert_array_equal(strokes.background[0], [[5, 5], [5, 70]])
    assert (strokes.density[0].add, strokes.density[0].radius_px) == (False, 4.5)
    assert strokes.root.tolist() == [50, 75]
    assert strokes.size == SIZE
    assert strokes.photo == "oak.jpg"
    assert not strokes.crown.flags.writeable
    assert not strokes.branches[0].flags.writeable


def test_background_density_and_photo_may_be_left_out(tmp_path: Path) -> None:
    strokes = load_strokes(written(tmp_path, stroke_set(background=None, density=None, photo=None)))
    assert strokes.background == ()
    assert strokes.density == ()
    assert strokes.photo == ""


def test_edits_of_the_skeleton_are_kept(tmp_path: Path) -> None:
    edits = {"merge": [[60, 20.5], [60, 20.5]], "vertices": [[62, 18]]}
    strokes = load_strokes(written(tmp_path, stroke_set(skeleton=edits)), SIZE)
    assert_array_equal(strokes.skeleton.merge, [[60, 20.5]])
    assert_array_equal(strokes.skeleton.vertices, [[62, 18]])
    save_strokes(strokes, tmp_path / "again.json")
    assert_array_equal(load_strokes(tmp_path / "again.json", SIZE).skeleton.vertices, [[62, 18]])
    assert len(load_strokes(written(tmp_path, stroke_set()), SIZE).skeleton.merge) == 0
    for wrong, message in (
        ({"merged": []}, "merged"),
        ({"merge": [[1, 2, 3]]}, "merge"),
        ({"vertices": [[400, 2]]}, r"skeleton.vertices\[1\]: expected a point inside the photo"),
    ):
        with pytest.raises(InputError, match=message):
            load_strokes(written(tmp_path, stroke_set(skeleton=wrong)), SIZE)


def test_small_slips_of_the_hand_are_mended(tmp_path: Path) -> None:
    slips = stroke_set(
        crown=[[30, 10], [70, -1.9], [70, -1.9], [101.5, 50], [30, 50], [30, 10]],  # outside, twice, closed
        branches=[[[50, 75], [50, 75], [50, 30], [50, 30]]],
    )
    strokes = load_strokes(written(tmp_path, slips), SIZE)
    assert_allclose(strokes.crown, [[30, 10], [70, 0], [100, 50], [30, 50]], atol=1e-9)
    assert strokes.branches[0].tolist() == [[50, 75], [50, 30]]
    assert np.floor(strokes.crown).max(axis=0).tolist() == [99, 50]  # floor() of every point is a pixel


def test_a_byte_order_mark_is_no_fault(tmp_path: Path) -> None:
    path = tmp_path / "oak.json"
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(stroke_set()).encode())
    assert load_strokes(path).size == SIZE


REFUSED: dict[str, tuple[Any, str]] = {
    "no json": ("{", r"oak\.json: not valid JSON: .*line 1 column 2"),
    "nested": ("[" * 100_000, "nested too deeply"),
    "huge number": ('{"version": 1' + "0" * 5000 + "}", "not valid JSON: "),
    "empty": ("", r"the file is empty \(0 bytes\)"),
    "a list": ([1, 2], "expected a table of keys, came"),
    "unknown key": (stroke_set(crwon=[]), r"unknown key 'crwon'; did you mean 'crown'\?"),
    "far key": (stroke_set(zzz=1), "unknown key 'zzz'; known: version, photo, size, crown"),
    "version 2": (stroke_set(version=2), "version: expected 1, the only version there is so far, came 2"),
    "version missing": (stroke_set(version=None), "version is missing: expected 1"),
    "version true": (stroke_set(version=True), "version: expected 1"),
    "size float": (stroke_set(size=[100.5, 80]), r"size\[1\]: expected the photo's \[width, height\] .*came 100.5"),
    "size zero": (stroke_set(size=[0, 80]), r"size\[1\]: expected .* came 0"),
    "size vast": (stroke_set(size=[10**9, 10**9]), "size: expected at most 100 million pixels"),
    "size beyond": (stroke_set(size=[10**30, 1]), "size"),
    "crown missing": (stroke_set(crown=None), "crown is missing: expected one outline of at least 3 points"),
    "crown text": (stroke_set(crown="round"), "crown: expected one outline .* came 'round'"),
    "crown 2 points": (stroke_set(crown=[[30, 10], [70, 10]]), "crown has 2 different points; .* at least 3"),
    "crown 1 point often": (stroke_set(crown=[[30, 10]] * 5), "crown has 1 different point;"),
    "crown empty": (stroke_set(crown=[]), "crown has 0 different points"),
    "crown flat": (stroke_set(crown=[[10, 10], [50, 10], [30, 10]]), "crown encloses no area; draw it around"),
    "point of 3": (stroke_set(crown=[[1, 2, 3], [4, 5], [6, 7]]), r"crown\[1\]: expected .* came \[1, 2, 3\]"),
    "nan": (stroke_set(crown=[[30, 10], [70, float("nan")], [70, 50]]), r"crown\[2\]\[2\]: expected .* came nan"),
    "infinite": (stroke_set(branches=[[[50, 75], [50, float("-inf")]]]), r"branches\[1\]\[2\]\[2\]: .* came -inf"),
    "number as text": (stroke_set(crown=[["30", 10], [70, 1], [70, 50]]), r"crown\[1\]\[1\]: expected .* came '30'"),
    "number as truth": (stroke_set(crown=[[True, 10], [70, 1], [70, 50]]), r"crown\[1\]\[1\]: expected .* came True"),
    "outside": (
        stroke_set(crown=[[30, 10], [170, 10], [70, 50]]),
        r"crown\[2\]: expected a point inside the photo of 100 x 80 px, came \[170, 10\]; draw",
    ),
    "above": (stroke_set(branches=[[[50, 75], [50, -20]]]), r"branches\[1\]\[2\]: expected a point inside"),
    "no branch": (stroke_set(branches=[]), "branches is empty; draw at least one line up the trunk"),
    "trunk a point": (stroke_set(branches=[[[50, 75]]]), r"branches\[1\] has 1 different point; a line needs 2"),
    "zero length": (stroke_set(branches=[[[50, 75], [50, 30]], [[9, 9], [9, 9]]]), r"branches\[2\] has 1 different"),
    "background a point": (stroke_set(background=[[[1, 1]]]), r"background\[1\] has 1 different point"),
    "trunk downward": (stroke_set(branches=[[[50, 30], [50, 75]]]), r"branches\[1\] is the trunk .* 45 px below"),
    "trunk elsewhere": (
        stroke_set(branches=[[[5, 75], [5, 30]]]),
        r"branches\[1\], the trunk, ends 25 px away from the crown; draw it from the root up into the crown",
    ),
    "density key": (
        stroke_set(density=[{"add": True, "radius": 1, "path": [[1, 1]], "soft": 1}]),
        r"density\[1\]: unknown key 'soft'; known: add, radius, path",
    ),
    "density radius": (
        stroke_set(density=[{"add": True, "radius": 0, "path": [[1, 1]]}]),
        r"density\[1\]\.radius: expected the brush's radius in pixels, above 0, came 0",
    ),
    "density outside": (
        stroke_set(density=[{"add": True, "radius": 1, "path": [[1, 99]]}]),
        r"density\[1\]\.path\[1\]: expected a point inside",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_used_is_sent_back_with_a_remedy(tmp_path: Path, name: str) -> None:
    content, message = REFUSED[name]
    with pytest.raises(InputError, match=message) as caught:
        load_strokes(written(tmp_path, content))
    assert str(caught.value).startswith(str(tmp_path / "oak.json"))
    assert "\n" not in str(caught.value)


def test_strokes_of_another_photo(tmp_path: Path) -> None:
    path = written(tmp_path, stroke_set())
    with pytest.raises(InputError, match="size: expected the photo's 50 x 40, came 100 x 80; give the photo that"):
        load_strokes(path, (50, 40))
    with pytest.raises(InputError, match="expected the photo's 80 x 100, came 100 x 80; the photo was turned"):
        load_strokes(path, (80, 100))


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected a stroke set .*, but there is no such file"):
        load_strokes(tmp_path / "none.json")
    (tmp_path / "latin.json").write_bytes('{"photo": "Bäume"}'.encode("latin-1"))
    with pytest.raises(InputError, match="byte 12 is not UTF-8; save the file as UTF-8"):
        load_strokes(tmp_path / "latin.json")


def test_a_trunk_that_ends_just_below_the_crown_meets_it(tmp_path: Path) -> None:
    near = stroke_set(branches=[[[50, 75], [50, 51.5]]])  # 1.5 px below a crown of 40 px
    assert load_strokes(written(tmp_path, near)).root.tolist() == [50, 75]


def test_a_trunk_that_passes_through_the_crown_meets_it(tmp_path: Path) -> None:
    through = stroke_set(branches=[[[50, 75], [50, 2]]])  # no vertex of it lies inside
    assert len(load_strokes(written(tmp_path, through)).branches) == 1


def test_saving_and_loading_gives_the_same_strokes(tmp_path: Path) -> None:
    first = load_strokes(written(tmp_path, stroke_set(photo="Bäume/ö.jpg")))
    save_strokes(first, tmp_path / "again.json")
    again = load_strokes(tmp_path / "again.json")
    save_strokes(again, tmp_path / "more.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "more.json").read_bytes()
    assert again.photo == "Bäume/ö.jpg"
    assert_array_equal(again.crown, first.crown)
    assert again.density[0].radius_px == first.density[0].radius_px


def test_a_programmer_cannot_make_strokes_that_are_none() -> None:
    crown, trunk = np.array([[1.0, 1], [9, 1], [9, 9]]), np.array([[5.0, 9], [5, 5]])
    Strokes(crown, (trunk,), size=(10, 10))
    with pytest.raises(ValueError, match="expected at least 3"):
        Strokes(crown[:2], (trunk,))
    with pytest.raises(ValueError, match="needs the trunk"):
        Strokes(crown, ())
    with pytest.raises(ValueError, match="leave their photo of 8 x 8"):
        Strokes(crown, (trunk,), size=(8, 8))
    with pytest.raises(ValueError, match="NaN"):
        Strokes(np.array([[1.0, np.nan], [9, 1], [9, 9]]), (trunk,))


# Masks and geometry --------------------------------------------------------------------------------


def picture(mask: np.ndarray[Any, Any]) -> list[str]:
    return ["".join(".#"[int(pixel)] for pixel in row) for row in mask]


def test_fill_counts_pixels_whose_middle_is_inside() -> None:
    triangle = np.array([[1.0, 1], [6, 1], [1, 6]])
    rows = [".......", ".####..", ".###...", ".##....", ".#.....", ".......", "......."]
    assert picture(fill_outline(triangle, (7, 7))) == rows


@pytest.mark.parametrize("turn", [1, -1])
def test_both_loops_of_an_eight_are_inside(turn: int) -> None:
    eight = np.array([[0.0, 0], [6, 6], [6, 0], [0, 6]])[::turn]
    mask = fill_outline(eight, (6, 6))
    assert mask[2, 0]
    assert mask[3, 5]
    assert not mask[0, 3]


def test_an_outline_drawn_past_its_beginning_has_no_hole() -> None:
    square = np.array([[1.0, 1], [7, 1], [7, 7], [1, 7]])
    twice = np.concatenate([square, square[:3] + np.array([0.0, 0.4])])
    assert fill_outline(twice, (8, 8))[1:7, 1:7].all()


def test_fill_beyond_the_photo_is_cut_off() -> None:
    assert fill_outline(np.array([[-5.0, -5], [50, -5], [50, 50], [-5, 50]]), (4, 3)).all()


outlines = st.lists(st.tuples(st.floats(0, 12), st.floats(0, 9)), min_size=3, max_size=8).map(np.array)


@settings(deadline=None, max_examples=150)
@given(outlines)
def test_fill_agrees_with_the_winding_number_of_each_pixel(outline: np.ndarray[Any, Any]) -> None:
    column, row = np.meshgrid(np.arange(12), np.arange(9))
    middles = np.column_stack([column.ravel(), row.ravel()]) + 0.5
    plain = winding_number(middles, outline).reshape(9, 12) != 0
    fast = fill_outline(outline, (12, 9))
    near = np.zeros(len(middles), bool)  # a middle on the outline itself may go either way
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        along, away = b - a, middles - a
        t = np.clip(away @ along / max(along @ along, 1e-300), 0, 1)
        near |= np.linalg.norm(away - t[:, None] * along, axis=1) < 1e-6
    assert (plain == fast)[~near.reshape(9, 12)].all()


def test_distance_to_region() -> None:
    square = np.array([[2.0, 2], [6, 2], [6, 6], [2, 6]])
    assert distance_to_region(np.array([[3.0, 3], [4, 4]]), square) == 0  # inside
    assert distance_to_region(np.array([[0.0, 4], [9, 4]]), square) == 0  # through
    assert distance_to_region(np.array([[0.0, 0], [0, 9]]), square) == 2  # beside an edge
    assert distance_to_region(np.array([[9.0, 10], [9, 12]]), square) == pytest.approx(5)  # off a corner: 3-4-5
    assert distance_to_region(np.array([[4.0, 8], [8, 4]]), square) == pytest.approx(0, abs=1e-12)  # touches a corner


def test_draw_polyline_marks_the_pixels_under_it() -> None:
    mask = draw_polyline(np.array([[0.5, 1.5], [3.5, 1.5]]), (5, 3))
    assert picture(mask) == [".....", "####.", "....."]


# Attack --------------------------------------------------------------------------------------------

ODD = [None, True, -1, 0, 1e308, 10**40, float("nan"), float("inf"), "", "x", [], [[]], {}, [[1, 2]], {"a": 1}]


def mutated(content: Any, rng: np.random.Generator) -> Any:
    """A deep copy with one place in it replaced, removed or doubled."""
    content = copy.deepcopy(content)
    place, key = content, None
    for _ in range(rng.integers(1, 5)):
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        if not keys:
            break
        key = keys[rng.integers(len(keys))]
        if not isinstance(place[key], dict | list) or rng.random() < 0.3:
            break
        place = place[key]
    if key is None or (isinstance(place, list) and not (isinstance(key, int) and key < len(place))):
        return content
    action: Callable[[], Any] = [
        lambda: place.__setitem__(key, ODD[rng.integers(len(ODD))]),
        lambda: place.__delitem__(key),
        lambda: place.append(place[key]) if isinstance(place, list) else place.__setitem__(f"{key}s", 1),
    ][rng.integers(3)]
    if isinstance(place, dict) and key not in place:
        return content
    action()
    return content


def test_mutated_stroke_sets_give_strokes_or_an_input_error(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    for _ in range(400):
        content = stroke_set()
        for _ in range(rng.integers(1, 4)):
            content = mutated(content, rng) if content else content
        try:
            strokes = load_strokes(written(tmp_path, content))
        except InputError as error:
            message = str(error)
        else:
            message = ""
            assert fill_outline(strokes.crown, strokes.size or SIZE).any()
        assert "\n" not in message


@settings(deadline=None, max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(min_size=0, max_size=200))
def test_random_bytes_give_an_input_error(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.json").write_bytes(content)
    with pytest.raises(InputError):
        load_strokes(tmp_path / "x.json")


def test_the_shared_stroke_sets_are_all_good(shared: Path) -> None:
    paths = [*(shared / "photos").glob("*.json"), *(shared / "ground_truth").glob("*/strokes*.json")]
    assert len(paths) > 20
    for path in paths:
        assert len(load_strokes(path).crown) > 10
