"""Levels of detail from one skeleton: what they keep, which leaves and limbs stay, and budgets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.errors import InputError
from forestgen.tree.level import full_level
from forestgen.tree.lod import LOD_STEPS, LodStep, coarser_level, fit_level, step_at
from forestgen.tree.lod_crown import crown_of
from forestgen.tree.lod_prototypes import covered_area
from forestgen.tree.model import LeafPrototype, Leaves, Mesh, TreeModel
from forestgen.tree.skeleton import Skeleton
from tests.tree.lod_trees import bushy_tree

MODEL = bushy_tree(3000)
BARE = bushy_tree(0)


def covered(leaves: Leaves, prototypes: Sequence[LeafPrototype], rgba: np.ndarray) -> float:
    """Opaque area of all leaves, m2."""
    area = np.array([covered_area(prototype, rgba) for prototype in prototypes])
    return float((leaves.size**2 * area[leaves.prototype]).sum())


def across(mesh: Mesh) -> float:
    """How much a mesh of convex tubes covers on average over all directions, m2 (Cauchy: a quarter of its surface)."""
    corner = mesh.points[mesh.faces]
    return float(np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum()) / 8


def trunk_only(n_leaves: int) -> TreeModel:
    """A post of two nodes, with the first leaves of MODEL."""
    leaves = MODEL.leaves
    few = Leaves(*(getattr(leaves, name)[:n_leaves] for name in ("position", "orientation", "size", "prototype")))
    skeleton = Skeleton(np.array([[0, 0, 0], [0, 6.0, 0]]), np.array([-1, 0]), np.array([0.2, 0.1]))
    return replace(MODEL, skeleton=skeleton, leaves=few)


@pytest.mark.parametrize("step", LOD_STEPS, ids=("LOD1", "LOD2"))
def test_a_level_keeps_the_leaves_area_with_fewer_larger_leaves(step: LodStep) -> None:
    level, rgba = coarser_level(MODEL, step), MODEL.atlas.rgba
    assert len(level.leaves) < len(MODEL.leaves)
    before = covered(MODEL.leaves, MODEL.atlas.prototypes, rgba)
    assert_allclose(covered(level.leaves, level.prototypes, rgba), before, rtol=1e-9)
    assert level.n_triangles < full_level(MODEL).n_triangles / 3
    assert level.switch_px == step.switch_px


@pytest.mark.parametrize("step", LOD_STEPS, ids=("LOD1", "LOD2"))
def test_a_level_keeps_each_colours_share_of_the_area(step: LodStep) -> None:
    level, rgba = coarser_level(MODEL, step), MODEL.atlas.rgba
    for k in range(2):
        parts = [
            covered(Leaves(*(a[leaves.prototype == k] for a in vars(leaves).values())), prototypes, rgba)
            for leaves, prototypes in ((MODEL.leaves, MODEL.atlas.prototypes), (level.leaves, level.prototypes))
        ]
        assert parts[1] == pytest.approx(parts[0], rel=0.05)


@pytest.mark.parametrize("model", [MODEL, BARE], ids=("leafy", "bare"))
@pytest.mark.parametrize("step", LOD_STEPS, ids=("LOD1", "LOD2"))
def test_a_level_keeps_what_its_wood_covers(model: TreeModel, step: LodStep) -> None:
    level = coarser_level(model, step)
    # a twig is thickened to its parent's size at most, which leaves some of what was dropped uncovered
    assert 0.92 * across(model.mesh) <= across(level.mesh) <= 1.03 * across(model.mesh)
    assert len(level.mesh.faces) < 0.5 * len(model.mesh.faces)
    extent = [np.array([mesh.points.min(axis=0), mesh.points.max(axis=0)]) for mesh in (model.mesh, level.mesh)]
    if model is BARE:  # its twigs are its outline
        assert_allclose(extent[1], extent[0], atol=0.03 * model.height)


def test_leaves_of_a_coarser_level_are_among_those_of_the_finer() -> None:
    full, fine, coarse = (
        {tuple(turn) for turn in leaves.orientation}
        for leaves in (MODEL.leaves, *(coarser_level(MODEL, step).leaves for step in LOD_STEPS))
    )
    assert coarse < fine < full


def test_a_leaf_that_stays_grows_about_its_own_middle() -> None:
    level = coarser_level(MODEL, LOD_STEPS[1])
    crown = crown_of(MODEL)
    kept = np.sort(crown.order.order[: len(level.leaves)])
    assert_array_equal(MODEL.leaves.orientation[kept], level.leaves.orientation)
    moved = np.linalg.norm(level.leaves.position - MODEL.leaves.position[kept], axis=1)
    assert np.all(moved <= 0.75 * np.abs(level.leaves.size - MODEL.leaves.size[kept]) + 1e-9)


def test_the_same_model_gives_the_same_level_and_keeps_its_own() -> None:
    before = MODEL.leaves.position.copy()
    first, second = (coarser_level(MODEL, LOD_STEPS[0]) for _ in range(2))
    for a, b in ((first.mesh, second.mesh), (first.leaves, second.leaves)):
        for name in vars(a):
            assert_array_equal(getattr(a, name), getattr(b, name))
    assert_array_equal(MODEL.leaves.position, before)


@pytest.mark.parametrize("n_leaves", [0, 1])
def test_a_post_with_no_leaf_or_one_has_levels(n_leaves: int) -> None:
    model = trunk_only(n_leaves)
    for step in LOD_STEPS:
        level = coarser_level(model, step)
        assert level.n_instances == n_leaves
        assert 0 < len(level.mesh.faces) < len(model.mesh.faces)
        assert np.ptp(level.mesh.points[:, 1]) == pytest.approx(6.0, rel=0.1)
        if n_leaves:
            assert level.leaves.size[0] == pytest.approx(model.leaves.size[0], rel=0.2)


def test_a_tree_without_wood_stays_without() -> None:
    nothing = Mesh(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((0, 3), np.int64))
    level = coarser_level(replace(MODEL, mesh=nothing), LOD_STEPS[0])
    assert len(level.mesh.faces) == 0
    assert len(level.leaves) > 0


@pytest.mark.parametrize("fault", [{"switch_px": 0}, {"density": 0}, {"density": 1.5}, {"leaf_triangles": 1}])
def test_a_step_that_makes_no_sense_is_refused(fault: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"expected|at least"):
        replace(LOD_STEPS[0], **fault)


def test_a_finer_step_keeps_more() -> None:
    levels = [coarser_level(MODEL, step_at(px)) for px in (60, 150, 400, 900)]
    triangles = [level.n_triangles for level in levels]
    assert triangles == sorted(triangles)
    assert len(coarser_level(MODEL, step_at(2000)).leaves) == len(MODEL.leaves)


@pytest.mark.parametrize("budget", [20_000, 8_000, 3_000])
def test_a_budget_of_triangles_is_kept_and_used(budget: int) -> None:
    level = fit_level(MODEL, max_triangles=budget)
    assert 0.9 * budget <= level.n_triangles <= budget
    assert level.switch_px < np.inf


def test_a_budget_of_instances_is_kept_exactly_and_leaves_the_wood_alone() -> None:
    level = fit_level(MODEL, max_instances=700)
    assert level.n_instances == 700
    assert level.mesh is MODEL.mesh
    assert level.prototypes == MODEL.atlas.prototypes
    both = fit_level(MODEL, max_triangles=9_000, max_instances=500)
    assert both.n_instances == 500
    assert 0.8 * 9_000 <= both.n_triangles <= 9_000


def test_a_budget_that_the_tree_keeps_changes_nothing() -> None:
    level, full = fit_level(MODEL, max_triangles=10**7, max_instances=3000), full_level(MODEL)
    assert (level.mesh, level.leaves, level.switch_px) == (full.mesh, full.leaves, np.inf)


@pytest.mark.parametrize("budget", [{"max_triangles": 5}, {"max_instances": 0}])
def test_a_budget_no_level_keeps_is_refused_with_the_number_that_would_do(budget: dict[str, int]) -> None:
    with pytest.raises(InputError, match=r"coarsest level of 'bush' has \d+.*: give at least \d+") as refused:
        fit_level(MODEL, **budget)
    name = next(iter(budget))
    least = int(str(refused.value).split()[-1])
    found = fit_level(MODEL, **{name: least})
    assert (found.n_triangles if name == "max_triangles" else found.n_instances) == least
    with pytest.raises(InputError, match=f"give at least {least}"):
        fit_level(MODEL, **{name: least - 1})
