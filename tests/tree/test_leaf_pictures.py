"""Leaf textures by season and light: which files there are, and what they share."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_array_equal

from forestgen.tree.delight import delit
from forestgen.tree.leaf_pictures import leaf_pictures, picture_name
from forestgen.tree.model import Atlas
from forestgen.tree.seasons import SEASONS
from tests.tree.season_atlases import GREEN, ORANGE, painted_atlas


def test_names() -> None:
    assert picture_name("leaf", "photo") == "leaf.png"
    assert picture_name("leaf_cards", "winter") == "leaf_cards_winter.png"
    assert picture_name("leaf", "autumn", is_delit=True) == "leaf_autumn_delit.png"


def test_a_summer_photo_needs_one_more_file() -> None:
    atlas = painted_atlas([GREEN] * 8)
    found = leaf_pictures(atlas, SEASONS, seed=1)
    assert found.baked == {"photo": "leaf.png", "summer": "leaf.png", "autumn": "leaf_autumn.png"}
    assert sorted(found.files) == ["leaf.png", "leaf_autumn.png"]
    assert_array_equal(found.files["leaf.png"], atlas.rgba)
    assert not found.delit


def test_light_is_taken_from_each_season_that_is_there() -> None:
    found = leaf_pictures(painted_atlas([ORANGE] * 8), SEASONS, with_delit=True, seed=1)
    assert found.baked == {"photo": "leaf.png", "summer": "leaf_summer.png", "autumn": "leaf.png"}
    assert found.delit == {"photo": "leaf_delit.png", "summer": "leaf_summer_delit.png", "autumn": "leaf_delit.png"}
    atlas = painted_atlas([ORANGE] * 8)
    summer = Atlas(found.files["leaf_summer.png"], atlas.prototypes)
    assert_array_equal(found.files["leaf_summer_delit.png"], delit(summer))


def test_an_evergreen_has_a_winter_and_no_autumn() -> None:
    found = leaf_pictures(painted_atlas([GREEN] * 8), SEASONS, evergreen=True, seed=1)
    assert found.baked == {"photo": "leaf.png", "summer": "leaf.png", "autumn": "leaf.png", "winter": "leaf_winter.png"}


def test_a_bare_tree_has_none_and_a_seed_gives_the_same() -> None:
    assert not leaf_pictures(Atlas(np.zeros((1, 1, 4), np.uint8), ()), SEASONS, with_delit=True, seed=1).files
    atlas = painted_atlas([GREEN] * 8)
    one, same, other = (leaf_pictures(atlas, ["autumn"], seed=seed).files["leaf_autumn.png"] for seed in (1, 1, 2))
    assert_array_equal(one, same)
    assert not np.array_equal(one, other)
