"""Prim names: any name becomes an ASCII identifier, and no two alike."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forestgen.scene.names import MAX_LENGTH, RESERVED, prim_names

IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("plane_01", "plane_01"),
        ("old oak", "old_oak"),
        ("  oak -- (big)  ", "oak_big"),
        ("3rd tree", "_3rd_tree"),
        ("Älterer Ahorn", "Alterer_Ahorn"),
        ("🌳", "tree"),
        ("🌳 oak 🍂", "oak"),
        ("銀杏", "tree"),
        ("a/b\\c:d", "a_b_c_d"),
        ("../../etc", "etc"),
        ("_private_", "_private_"),
        ("x" * 300, "x" * 64),
        ("9" * 300, "_" + "9" * 63),
        ("con", "con_2"),  # a folder that Windows cannot make
    ],
)
def test_odd_names(name: str, expected: str) -> None:
    assert prim_names([name]) == [expected]


def test_collisions_are_numbered_in_order() -> None:
    found = prim_names(["oak", "oak!", "Oak", "oak_2", "oak?"])
    assert found == ["oak", "oak_2", "Oak_3", "oak_2_2", "oak_4"]


def test_a_long_name_keeps_its_number_within_the_limit() -> None:
    first, second, *_, last = prim_names(["y" * 300 + str(k) for k in range(12)])
    assert first == "y" * 64
    assert second == "y" * 62 + "_2"
    assert last == "y" * 61 + "_12"


def test_fallback_names_a_scene() -> None:
    assert prim_names(["森"], fallback="scene") == ["scene"]


def test_ten_thousand_of_one_name_are_numbered_at_once() -> None:
    names = prim_names(["birch"] * 10_000)
    assert names[-1] == "birch_10000"
    assert len(set(names)) == 10_000


@given(st.lists(st.text(max_size=90), max_size=12))
def test_every_list_of_names_gives_different_identifiers(names: list[str]) -> None:
    found = prim_names(names)
    assert len({name.lower() for name in found}) == len(names)
    for name in found:
        assert IDENTIFIER.fullmatch(name)
        assert len(name) <= MAX_LENGTH
        assert name.lower() not in RESERVED


@given(st.lists(st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,63}", fullmatch=True), unique_by=str.lower, max_size=8))
def test_names_that_are_identifiers_already_stay(names: list[str]) -> None:
    kept = [name for name in names if name.lower() not in RESERVED]
    assert prim_names(kept) == kept


@given(st.lists(st.text(max_size=20), max_size=8), st.text(max_size=20))
def test_a_further_name_leaves_the_earlier_ones_alone(names: list[str], more: str) -> None:
    assert prim_names([*names, more])[:-1] == prim_names(names)
