"""Forest: trees first, then copies, each where the manifest puts it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.scene.forest import Forest, place
from forestgen.scene.manifest import CopySpec, Scene, TreeSpec
from forestgen.tree.methods import METHODS


def tree(name: str, prim_name: str, position: tuple[float, float, float], heading: float = 0.0) -> TreeSpec:
    return TreeSpec(name, prim_name, 10.0, METHODS["tan2008"], "tan2008", 0, (), position, heading)


def scene(*copies: CopySpec) -> Scene:
    trees = (tree("Eiche 1", "Eiche_1", (0, 0, 0)), tree("plane", "plane", (5, 0.5, -2), math.pi / 2))
    return Scene("s", 0, Path("scene.toml"), Path("/"), trees, copies)


def test_trees_first_then_copies() -> None:
    forest = place(
        scene(CopySpec("plane", (9, 0, 0), 0.25, 0.8), CopySpec("Eiche 1", (1, 2, 3)), CopySpec("plane", (7, 0, 7)))
    )
    assert forest.prototypes == ("Eiche_1", "plane")
    assert forest.names == ("Eiche_1", "plane", "plane_copy", "Eiche_1_copy", "plane_copy_2")
    assert forest.prototype.tolist() == [0, 1, 1, 0, 1]
    assert forest.position.tolist() == [[0, 0, 0], [5, 0.5, -2], [9, 0, 0], [1, 2, 3], [7, 0, 7]]
    assert_allclose(forest.yaw, [0, math.pi / 2, 0.25, 0, 0])
    assert forest.scale.tolist() == [1, 1, 0.8, 1, 1]
    assert len(forest) == 5


def test_a_copys_name_never_takes_that_of_a_tree() -> None:
    spec = scene(CopySpec("plane", (9, 0, 0)))
    trees = (*spec.trees, tree("plane copy", "plane_copy", (0, 0, 9)))
    forest = place(Scene("s", 0, spec.path, spec.root, trees, spec.copies))
    assert forest.names == ("Eiche_1", "plane", "plane_copy", "plane_copy_2")


def test_copies_of_long_names_stay_apart() -> None:
    long = "x" * 64
    spec = Scene(
        "s",
        0,
        Path("a"),
        Path("/"),
        (tree(long, long, (0, 0, 0)),),
        tuple(CopySpec(long, (k, 0, 0)) for k in range(30)),
    )
    names = place(spec).names
    assert len(set(names)) == 31
    assert max(map(len, names)) <= 64


def test_many_copies() -> None:
    forest = place(scene(*(CopySpec("plane", (k, 0, 0)) for k in range(10_000))))
    assert len(set(forest.names)) == 10_002


def test_a_forest_that_is_none_cannot_be_made() -> None:
    good = {"prototypes": ("a",), "names": ("a",), "prototype": [0], "position": [[0, 0, 0]], "yaw": [0], "scale": [1]}
    Forest(**good)  # type: ignore[arg-type]
    for change, message in [
        ({"prototype": [1]}, "points outside"),
        ({"scale": [0]}, "must be positive"),
        ({"names": ("a", "b")}, "2 names for 1 trees"),
        ({"yaw": [0, 1]}, "T = "),
    ]:
        with pytest.raises(ValueError, match=message):
            Forest(**(good | change))  # type: ignore[arg-type]


def test_an_empty_forest_has_no_tree() -> None:
    empty = Forest((), (), np.zeros(0, int), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    assert len(empty) == 0
