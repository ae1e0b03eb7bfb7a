"""The sample scenes of the repository: complete, valid, each stroke set with its photo."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from PIL import Image

from forestgen.scene.forest import place
from forestgen.scene.manifest import Scene, load_scene
from forestgen.tree.strokes import load_strokes

METHODS = {"street": "tan2008", "woods": "tan2008", "garden": "neubert2007", "growing": "kim2014"}


@pytest.fixture(scope="module", params=sorted(METHODS))
def scene(request: pytest.FixtureRequest, scenes: Path) -> Scene:
    return load_scene(scenes / str(request.param) / "scene.toml")


def test_every_tree_has_its_photo_and_strokes(scene: Scene) -> None:
    for tree in scene.trees:
        for view in tree.views:
            with Image.open(view.photo) as photo:
                strokes = load_strokes(view.strokes, photo.size)
            assert len(strokes.branches) >= 1, tree.name
            hint = json.loads(view.strokes.read_text())["photo"]
            assert (view.strokes.parent / hint).resolve() == view.photo.resolve(), tree.name


def test_trees_stand_apart_and_on_the_ground(scene: Scene) -> None:
    forest = place(scene)
    assert (forest.position[:, 1] == 0).all()
    for k in range(len(forest)):
        for other in range(k):
            assert ((forest.position[k] - forest.position[other]) ** 2).sum() > 2.0**2


def test_samples_show_the_method_as_it_comes(scene: Scene) -> None:
    """No gate lowered, no setting bent for the sake of the samples."""
    for tree in scene.trees:
        assert tree.method_name == METHODS[scene.name]
        assert not tree.gates
        assert not tree.stages


def test_street_is_a_street(scenes: Path) -> None:
    street = load_scene(scenes / "street" / "scene.toml")
    assert len({tree.views[0].photo for tree in street.trees}) == len(street.trees) >= 6
    assert len(street.copies) >= 3


def test_woods_are_one_photo_of_four_trees(scenes: Path) -> None:
    woods = load_scene(scenes / "woods" / "scene.toml")
    assert len({tree.views[0].photo for tree in woods.trees}) == 1
    assert len({tree.views[0].strokes for tree in woods.trees}) == len(woods.trees) == 4
    assert len({tree.position[2] for tree in woods.trees}) > 2  # placed in depth


def test_the_garden_has_two_photos_a_tree_and_painted_foliage(scenes: Path) -> None:
    garden = load_scene(scenes / "garden" / "scene.toml")
    for tree in garden.trees:
        first, second = tree.views
        assert second.azimuth - first.azimuth == pytest.approx(math.pi / 2)
    painted = [load_strokes(view.strokes).density for view in garden.trees[1].views]
    assert all(any(stroke.add for stroke in density) for density in painted)
    assert any(not stroke.add for stroke in painted[0])  # the hole


def test_nothing_lies_about_unused(scenes: Path) -> None:
    used: set[Path] = set()
    for name in METHODS:
        for view in (view for tree in load_scene(scenes / name / "scene.toml").trees for view in tree.views):
            used |= {view.photo.resolve(), view.strokes.resolve()}
    lying = [*scenes.glob("*/photos/*"), *(scenes.parent / "stroke_sets").glob("*/*.json")]
    assert {path.resolve() for path in lying} == used


def test_where_the_samples_come_from_is_said(scenes: Path) -> None:
    note = (scenes / "README.md").read_text()
    for word in ("ez-tree", "MIT", "Blender", "Poly Haven"):
        assert word in note
