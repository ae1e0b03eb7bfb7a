"""The order in which leaves are kept: by prototype, then limb by limb, and nothing else changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from forestgen.tree.leaf_sort import sorted_leaves
from forestgen.tree.level import NO_LEAVES
from forestgen.tree.limb_tree import limb_tree
from forestgen.tree.model import Leaves
from forestgen.tree.wind import limb_of_leaves
from tests.tree.skeletons import fork, polyline, random_tree
from tests.usd.models import random_leaves


def rows(leaves: Leaves) -> list[tuple[float, ...]]:
    """All numbers of each leaf."""
    table = np.column_stack([leaves.position, leaves.orientation, leaves.size, leaves.prototype])
    return [tuple(row) for row in table.tolist()]


def test_a_fork_is_sorted_by_hand() -> None:
    #   trunk up to 4 m, limb 0; a side branch to +X at 2 m, limb 1
    foot = np.array([[0, 3.5, 0.1], [1.2, 2, 0.1], [0, 0.5, 0.1], [0.8, 2, 0.1], [0, 1.5, 0.1]])
    leaves = Leaves(foot, np.tile([1.0, 0, 0, 0], (5, 1)), np.arange(5) + 1.0, np.array([0, 0, 0, 0, 1]))
    assert_array_equal(sorted_leaves(leaves, fork(angle_deg=90.0)).size - 1, [2, 0, 3, 1, 4])


def test_prototypes_and_limbs_rise_and_no_leaf_is_lost() -> None:
    skeleton = random_tree(400, rng=np.random.default_rng(1))
    anyhow = random_leaves(3000, 7, np.random.default_rng(2))
    low, high = skeleton.position.min(axis=0), skeleton.position.max(axis=0)
    leaves = replace(anyhow, position=low + (anyhow.position - [-1, 1, -1]) / 2 * (high - low))
    ordered = sorted_leaves(leaves, skeleton)
    assert sorted(rows(ordered)) == sorted(rows(leaves))
    assert rows(ordered) != rows(leaves)
    limb = limb_of_leaves(ordered, limb_tree(skeleton))
    assert len(np.unique(limb)) > 30
    key = ordered.prototype * (limb.max() + 1) + limb
    assert np.all(np.diff(key) >= 0)
    assert rows(sorted_leaves(ordered, skeleton)) == rows(ordered)


def test_no_leaves_and_wood_without_thickness() -> None:
    assert sorted_leaves(NO_LEAVES, polyline([[0, 0, 0]], np.nan)) is NO_LEAVES
    with pytest.raises(ValueError, match="radius"):
        sorted_leaves(random_leaves(3, 1, np.random.default_rng(2)), polyline([[0, 0, 0], [0, 1, 0]], np.nan))
