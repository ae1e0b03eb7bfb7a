"""Trees of several photos: which views a manifest may give, and what is said of the others."""

from __future__ import annotations

from pathlib import Path

import pytest

from forestgen.errors import InputError
from tests.scene.manifests import HEAD, MANY_VIEWS, load

VIEW = """
[[tree.view]]
photo = "photos/oak_front.png"
strokes = "../../stroke_sets/street/oak_front.json"
"""


def tree_of(*views: str, method: str = MANY_VIEWS, own: str = "") -> str:
    """A manifest of one tree with these lines in its [[tree.view]] tables."""
    tables = "".join(VIEW + view + "\n" for view in views)
    return f'{HEAD}[[tree]]\nname = "oak"\nheight = 9\nmethod = "{method}"\n{own}\n{tables}'


def azimuths(*degrees: float) -> list[str]:
    return [f"azimuth = {azimuth}" for azimuth in degrees]


@pytest.mark.parametrize("views", [[0.0], [0, 90], [0, 180], [-45, 45], [40.0 * k for k in range(9)]])
def test_any_number_of_directions_is_read(place_of_scene: Path, views: list[float]) -> None:
    (tree,) = load(place_of_scene, tree_of(*azimuths(*views))).trees
    assert len(tree.views) == len(views)


def test_one_azimuth_at_two_elevations_is_two_directions(place_of_scene: Path) -> None:
    assert load(place_of_scene, tree_of("azimuth = 0", "elevation = 20")).trees


REFUSED: dict[str, tuple[str, str]] = {
    "same": (tree_of(*azimuths(90, 90)), r"view\[2\]\.azimuth: expected another direction than that of view\[1\]"),
    "a turn on": (
        tree_of(*azimuths(0, 45, 360)),
        r"view\[3\]\.azimuth: .* that of view\[1\], came the same, 360; give",
    ),
    "none given": (tree_of("", ""), r"view\[2\]\.azimuth: .* came the same, 0; give the degrees by which the camera"),
    "too many": (
        tree_of(*azimuths(0, 90), method="tan2008"),
        r"view: method 'tan2008' takes 1 photo of a tree in its stage 'lift', came 2; give 1, or choose another method",
    ),
    "nine": (tree_of(*azimuths(*range(0, 360, 40)), method="tan2008_paper"), r"'tan2008_paper' takes 1 .* came 9;"),
    "a hundred": (
        tree_of(*azimuths(*range(100))),
        r"view: expected tables in double brackets, .* 99 at most, came a li",
    ),
    "none": (tree_of(own="view = []"), "photo is missing: expected photo and strokes, or one"),
    "number": (tree_of(own="view = 2"), r"view: expected tables in double brackets, \[\[tree.view\]\], .*, came 2"),
    "texts": (tree_of(own='view = ["a.png"]'), r"view\[1\]: expected tables in double brackets, .* came 'a.png'"),
    "photo too": (tree_of("", own='photo = "a.png"'), r"has both a photo of its own and \[\[tree.view\]\]; move it"),
    "no strokes": (
        tree_of("").replace("strokes", "stroke"),
        r"view\[1\]: unknown key 'stroke'; did you mean 'strokes'",
    ),
    "nan": (tree_of(*azimuths(0, float("nan"))), r"view\[2\]\.azimuth: expected degrees by .* \+Y, .* came nan"),
    "text": (tree_of("", 'azimuth = "left"'), r"view\[2\]\.azimuth: expected degrees by .* came 'left'"),
    "height": (tree_of("height = 3"), r"view\[1\]: unknown key 'height'; known: photo, strokes, azimuth"),
    "root": (tree_of("root = [1]"), r"view\[1\]\.root: expected the tree's foot \[x, y\] in pixels, came \[1\]"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_wrong_is_said_in_one_line(place_of_scene: Path, name: str) -> None:
    text, message = REFUSED[name]
    with pytest.raises(InputError, match=message) as caught:
        load(place_of_scene, text)
    assert str(caught.value).startswith(f"{place_of_scene / 'scene.toml'}: tree[1] 'oak': ")
    assert "\n" not in str(caught.value)
