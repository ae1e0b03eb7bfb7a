"""The subtree library: predefined, from the visible branches, and the user's own."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.errors import InputError
from forestgen.tree.grow.placement import patterns, place
from forestgen.tree.grow.subtree_library import (
    PREDEFINED,
    choose_diverse,
    difference,
    load_subtrees,
    subtrees_of,
    turn_to_y,
)
from forestgen.tree.skeleton import Skeleton
from tests.tree.grow.crowns import two_limbs


def test_predefined_subtrees_look_like_branching() -> None:
    subtrees = load_subtrees(PREDEFINED)
    assert {(s.type, s.form) for s in subtrees} == {
        (t, f) for t in ("end", "along") for f in ("decurrent", "excurrent")
    }
    for subtree in subtrees:
        before = np.where(
            (subtree.parent < 0)[:, None], subtree.at[:, None] * [0, 1, 0], subtree.position[subtree.parent]
        )
        step = subtree.position - before
        first = subtree.parent < 0
        angle = np.degrees(np.arccos(step[first, 1] / np.linalg.norm(step[first], axis=1)))
        assert angle.max() < 105
        assert np.ptp(subtree.position[:, 2]) > 0.05 or subtree.name == "spray_flat"  # in three dimensions
        if subtree.type == "end":
            assert (subtree.at == 1).all()
        length = np.bincount(subtree.branch, np.linalg.norm(step, axis=1))
        assert length.max() < 1.01  # children are shorter than their parents
        assert len(set(np.round(length, 3))) > 1  # and of unequal length


def test_turning_takes_a_direction_to_y_without_stretching() -> None:
    direction = np.random.default_rng(0).normal(size=(50, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    direction[0], direction[1] = [0, 1, 0], [0, -1, 0]
    turn = turn_to_y(direction)
    assert_allclose(np.einsum("uij,uj->ui", turn, direction), np.tile([0, 1, 0], (50, 1)), atol=1e-9)
    assert_allclose(turn @ np.swapaxes(turn, 1, 2), np.tile(np.eye(3), (50, 1, 1)), atol=1e-9)
    assert_allclose(np.linalg.det(turn), 1, atol=1e-9)


def test_a_visible_subtree_put_back_on_its_own_branch_is_what_it_was() -> None:
    skeleton = two_limbs()
    (subtree,) = subtrees_of(skeleton, "decurrent", 7)
    placed = place(skeleton.position[:8], patterns([subtree], 1))
    limbs = skeleton.position[8:]
    gap = np.linalg.norm(placed.position[:, None] - limbs, axis=2).min(axis=0)
    assert_allclose(gap, 0, atol=1e-9)


def test_a_scaled_branch_scales_its_subtree_and_turning_keeps_lengths() -> None:
    (subtree,) = subtrees_of(two_limbs(), "decurrent", 7)
    small = place(np.array([[0.0, 0, 0], [0, 1, 0]]), patterns([subtree], 12))
    large = place(np.array([[0.0, 0, 0], [3, 0, 0]]), patterns([subtree], 12))
    assert_allclose(large.length, 3 * small.length, atol=1e-9)
    ends = small.position.reshape(12, -1, 3)[:, -1]
    angle = np.sort(np.degrees(np.arctan2(ends[:, 2], ends[:, 0])) % 360)
    assert_allclose(np.diff(angle), 30, atol=1e-6)


def test_repeated_subtrees_are_kept_once() -> None:
    trunk = np.column_stack([np.zeros(5), np.arange(5.0), np.zeros(5)])
    both = []
    for side in (1, -1):  # two limbs with the same twig at the same share
        limb = np.array([[1.0, 1, 0], [2, 2, 0], [3, 3, 0]]) * [side, 1, 1]
        both.append(np.concatenate([limb, [[2.0 * side, 2.6, 0.6]]]))
    parent = np.array([-1, 0, 1, 2, 3, 2, 5, 6, 6, 2, 9, 10, 10])
    skeleton = Skeleton(np.concatenate([trunk, *both]), parent, np.full(13, np.nan))
    assert len(subtrees_of(skeleton, "decurrent")) == 2  # the whole tree, and one limb of the two


def test_the_chosen_ones_are_few_and_differ() -> None:
    subtrees = load_subtrees(PREDEFINED)
    chosen = choose_diverse(subtrees, 4)
    assert len(chosen) == 4
    worst = min(difference(a, b) for i, a in enumerate(chosen) for b in chosen[i + 1 :])
    first = min(difference(a, b) for i, a in enumerate(subtrees[:4]) for b in subtrees[i + 1 : 4])
    assert worst >= first


GOOD = {
    "version": 1,
    "type": "end",
    "form": "decurrent",
    "on": "any",
    "branches": [{"from": None, "at": 1.0, "path": [[0.1, 1.2, 0.0], [0.2, 1.4, 0.1]]}],
}


def test_a_users_own_subtree_is_read(tmp_path: Path) -> None:
    branches = [*GOOD["branches"], {"from": 0, "at": 0.5, "path": [[0.0, 1.3, 0.3]]}]
    (tmp_path / "mine.json").write_text(json.dumps({**GOOD, "branches": branches}))
    (subtree,) = load_subtrees(tmp_path)
    assert (subtree.name, subtree.parent.tolist(), subtree.at.tolist()) == ("mine", [-1, 0, 0], [1, 1, 1])


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"version": 2}, "version 2 is not known"),
        ({"type": "middle"}, "'type' must be one of"),
        ({"on": "root"}, "'on' must be one of"),
        ({"branches": []}, "'branches' is empty"),
        ({"branches": [{"from": None, "at": 2, "path": [[0, 1, 0]]}]}, "'at' is 2.0; expected 0 to 1"),
        ({"branches": [{"from": 3, "at": 0, "path": [[0, 1, 0]]}]}, "'from' is 3"),
        ({"branches": [{"from": None, "at": 0, "path": [[0, 1]]}]}, "'path' must be a list"),
        ({"branches": [{"at": 0, "path": [[0, 1, 0]]}]}, "'from' is missing"),
    ],
)
def test_a_faulty_subtree_is_refused_with_its_file(tmp_path: Path, change: dict[str, object], reason: str) -> None:
    (tmp_path / "odd.json").write_text(json.dumps({**GOOD, **change}))
    with pytest.raises(InputError, match=reason) as caught:
        load_subtrees(tmp_path)
    assert "odd.json" in str(caught.value)


def test_an_empty_library_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no subtree"):
        load_subtrees(tmp_path)
