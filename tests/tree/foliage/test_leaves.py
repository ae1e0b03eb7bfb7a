"""Leaves: on young wood, inside the foliage, facing the light, in the colours of their places."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from forestgen.camera import Camera
from forestgen.tree.atlas import LeafAtlasFromPhoto
from forestgen.tree.foliage import LeavesAlongBranches
from forestgen.tree.foliage_colour import prototype_lab
from forestgen.tree.foliage_crown import Crown
from forestgen.tree.foliage_fit import Placement, blade_samples, draw_wood, footprint, make_target
from forestgen.tree.foliage_twigs import young_wood
from forestgen.tree.leaf_scale import leaf_length
from forestgen.tree.mattes import Mattes
from forestgen.tree.model import Atlas, Leaves
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View
from tests.synthetic import drawn_tree
from tests.tree.foliage.crown import drawn, grow, rotation


def test_leaves_cover_the_foliage_and_nothing_else(
    leaves: Leaves, skeleton: Skeleton, view: View, atlas: Atlas
) -> None:
    cover, foliage = drawn(leaves, view, atlas), view.mattes.is_foliage
    shared = (cover & foliage).sum()
    assert shared / foliage.sum() > 0.85
    bare = cover & ~foliage & ~view.mattes.is_branch & ~make_target(view, skeleton).is_grown
    assert bare.sum() / cover.sum() < 0.2  # polygons are drawn, 0.88 of whose opaque part is inside


def test_every_leaf_is_inside(leaves: Leaves, skeleton: Skeleton, view: View, atlas: Atlas) -> None:
    """Plain: leaf after leaf, point after point, through the camera itself."""
    target = make_target(view, skeleton)
    samples = blade_samples(atlas, 50)
    turn = rotation(leaves.orientation)
    for k in range(0, len(leaves), 37):
        points = leaves.position[k] + leaves.size[k] * samples[leaves.prototype[k]] @ turn[k].T
        column, row = np.floor(view.camera.project(points)).astype(int).T
        far = view.camera.depth(points)
        good = target.is_foliage[row, column] | (far < target.wood_depth[row, column])
        assert good.mean() >= 0.88 - 0.1  # other sample points than the strategy's


def test_petioles_stand_on_young_wood(leaves: Leaves, skeleton: Skeleton) -> None:
    wood = young_wood(skeleton)
    t = np.linspace(0, 1, 21)[:, None, None]
    on_axis = ((1 - t) * wood.start + t * wood.end).reshape(-1, 3)
    radius = np.tile(wood.radius, 21)
    for foot in leaves.position[::29]:
        gap = np.linalg.norm(on_axis - foot, axis=1) - radius
        assert gap.min() < 0.02
    assert wood.radius.max() <= 0.2 * skeleton.radius.max()


def test_leaves_clothe_all_sides(leaves: Leaves, skeleton: Skeleton) -> None:
    """Depth is spread as the twigs are, so the crown is no sheet."""
    wood = young_wood(skeleton)
    middle = (wood.start + wood.end) / 2
    assert np.std(leaves.position[:, 2]) > 0.75 * np.std(middle[:, 2])
    assert abs(np.mean(leaves.position[:, 2]) - np.mean(middle[:, 2])) < 0.3 * np.std(middle[:, 2])


def test_visible_wood_stays_visible(skeleton: Skeleton, view: View, atlas: Atlas, leaves: Leaves) -> None:
    """In front of the trunk's pixels there is no leaf; behind them leaves may be."""
    target = make_target(view, skeleton)
    samples = blade_samples(atlas, 40)
    placed = Placement(leaves.position, rotation(leaves.orientation), leaves.size, leaves.prototype)
    pixel = footprint(target, placed, samples).pixel
    flat = pixel[pixel >= 0]
    wood = view.mattes.is_branch & ~view.mattes.is_foliage
    assert wood.ravel()[np.unique(flat)].sum() < 0.12 * wood.sum()


def test_colours_come_back_from_the_front(leaves: Leaves, view: View, atlas: Atlas) -> None:
    red = prototype_lab(atlas)[leaves.prototype, 1] > 10
    middle = view.camera.project(leaves.position)[:, 0]
    away = np.abs(middle - view.camera.root_px[0]) > 0.3 * view.camera.px_per_metre
    assert (red == (middle > view.camera.root_px[0]))[away].mean() > 0.97


def test_same_seed_same_bytes(leaves: Leaves, skeleton: Skeleton, view: View, atlas: Atlas) -> None:
    again, other = grow(skeleton, view, atlas), grow(skeleton, view, atlas, seed=1)
    for name in ("position", "orientation", "size", "prototype"):
        assert getattr(again, name).tobytes() == getattr(leaves, name).tobytes()
    assert other.position.tobytes() != leaves.position.tobytes()


def test_sizes_vary_about_the_matte_rule(leaves: Leaves, view: View) -> None:
    usual = leaf_length([view])
    assert 0.25 * usual < leaves.size.min() < leaves.size.max() <= 2.0 * usual
    assert np.std(leaves.size) > 0.1 * usual


def test_the_paper_sizes_and_numbers_leaves_by_trunk_and_branch(skeleton: Skeleton, view: View, atlas: Atlas) -> None:
    paper = {"size_rule": "trunk", "number_rule": "branch", "fill_rounds": 0, "tries": 1, "size_spread": 0.0}
    leaves = grow(skeleton, view, atlas, inside=0.0, **paper)
    assert_allclose(leaves.size, 0.1 * skeleton.radius.max())
    branches = len(np.unique(young_wood(skeleton).branch))
    assert 50 * branches <= 1.05 * len(leaves) <= 1.1 * 200 * branches
    kept = grow(skeleton, view, atlas, **paper)
    assert len(kept) < len(leaves)


def test_no_more_leaves_than_allowed(skeleton: Skeleton, view: View, atlas: Atlas) -> None:
    assert len(grow(skeleton, view, atlas, most=100)) <= 115  # the number of a station is rounded by chance


def test_few_leaves_become_half_as_many_again(skeleton: Skeleton, view: View, atlas: Atlas) -> None:
    wood = young_wood(skeleton)
    crown = Crown([view], skeleton, atlas, LeavesAlongBranches().length(skeleton, [view]))
    plain = LeavesAlongBranches(few=0).number(wood, crown)
    assert LeavesAlongBranches(few=int(10 * plain)).number(wood, crown) == pytest.approx(1.5 * plain)
    assert LeavesAlongBranches(few=int(1.2 * plain)).number(wood, crown) == int(1.2 * plain)
    assert LeavesAlongBranches(few=int(0.5 * plain)).number(wood, crown) == plain


def test_a_bare_tree_bears_no_leaf(skeleton: Skeleton, atlas: Atlas) -> None:
    bare = drawn_tree(leaves=False).view
    empty = LeafAtlasFromPhoto()([bare], rng=np.random.default_rng(0))
    assert len(grow(skeleton, bare, empty)) == 0
    assert len(grow(skeleton, bare, atlas)) == 0


def test_every_view_is_heeded(skeleton: Skeleton, view: View, atlas: Atlas) -> None:
    """With a second view that shows foliage above one line only, no leaf stands below it."""
    camera = Camera(view.camera.size, view.camera.root_px, view.camera.px_per_metre, azimuth=np.pi / 2)
    line = int(camera.project(np.array([[0.0, 4.2, 0.0]]))[0, 1])
    foliage = np.zeros_like(view.mattes.foliage)
    foliage[:line] = 1
    side = replace(view, mattes=Mattes(foliage, np.zeros_like(foliage)), camera=camera)
    leaves = LeavesAlongBranches()(skeleton, [view, side], atlas, rng=np.random.default_rng(0))
    assert len(leaves) > 100
    xy = camera.project(leaves.position)
    wood = np.isfinite(draw_wood(side, skeleton)).astype(np.uint8)
    near_wood = cv2.dilate(wood, np.ones((25, 25), np.uint8)) > 0
    column, row = np.floor(xy[xy[:, 1] > line + 0.1 * camera.px_per_metre]).astype(int).T
    assert near_wood[row, column].all()  # it hides them


def test_fields_are_checked() -> None:
    with pytest.raises(ValueError, match="per_node is 0; expected at least 1"):
        LeavesAlongBranches(per_node=0)
    with pytest.raises(ValueError, match="inside is 2; expected a share"):
        LeavesAlongBranches(inside=2)
