"""Growth as a whole: fast equals plain, the contract, the crown is reached, the form is kept."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import cKDTree

from forestgen.arrays import stage_rng
from forestgen.tree.grow.attractors import Field, empty_field, image_attractors, picture_plane, turn_about
from forestgen.tree.grow.axes import axes_of, stem_end
from forestgen.tree.grow.crown_volume import crown_volume
from forestgen.tree.grow.densify import densify
from forestgen.tree.grow.growing_tree import GrowingTree
from forestgen.tree.grow.growth_form import growth_form, leader
from forestgen.tree.grow.limbs import LimbRules, add_turned_joints, draw_branches, grow_limbs
from forestgen.tree.grow.scores import PlacementRules, Scores
from forestgen.tree.grow.subtree_library import PREDEFINED, load_subtrees
from forestgen.tree.grow.subtree_replacement import SubtreeReplacement
from forestgen.tree.grow.twigs import turn_within
from forestgen.tree.skeleton import Skeleton, height_above_tips
from tests.tree.grow.crowns import PX, ball_view, cone_view, two_limbs
from tests.tree.grow.plain import PlainScores

PAPER = replace(SubtreeReplacement.paper(), iterations=20)


def grown_by(scores_type, **options):
    """Limbs grown with either kind of scores on a small case."""
    view = ball_view()
    volume = crown_volume([view])
    tree = GrowingTree(two_limbs())
    library = tuple(s for s in load_subtrees(PREDEFINED) if s.name in ("along_upright", "end_alternate"))
    rules = PlacementRules(library, 6, volume, 0.4, 0.3)
    ends = tree.segments()
    image, space = empty_field(), empty_field()
    image.add(image_attractors(volume.leafy[0], view.camera, 0.6), *[picture_plane(view.camera, end) for end in ends])
    add_turned_joints(tree, space, 0)
    space.add(volume.sample(0.9, stage_rng(0, "volume")), *ends)
    costs = []
    scores = scores_type(rules, [image], space, **options)
    grow_limbs(
        tree,
        scores,
        LimbRules(16, 4, 0.2, 0.0005, 0),
        rng=stage_rng(0, "grow"),
        on_step=lambda *step: costs.append(step),
    )
    return tree, costs, scores


@pytest.mark.parametrize("max_bytes", [96_000_000, 100_000])
def test_the_fast_engine_grows_the_plain_ones_tree(max_bytes: int) -> None:
    fast, fast_costs, scores = grown_by(Scores, max_bytes=max_bytes)
    plain, plain_costs, _ = grown_by(PlainScores)
    assert len(fast.parent) > 100
    assert_array_equal(fast.parent, plain.parent)
    assert_allclose(fast.position, plain.position, atol=1e-9)
    for one, other in zip(fast_costs, plain_costs, strict=True):
        assert one[:2] == other[:2]
        assert_allclose(list(one[2].values()), list(other[2].values()), rtol=1e-9)
    if max_bytes > 1_000_000:
        assert scores.n_bytes == sum(block.n_bytes for block in scores._blocks.values()) < max_bytes
    else:
        assert len(scores._blocks) < 8  # what the store had no room for was measured again, with the same result


def test_the_image_cost_never_rises() -> None:
    _, costs, _ = grown_by(Scores)
    image = [step[2]["image cost"] for step in costs]
    assert [step[0] for step in costs] == list(range(1, 17))
    assert all(a >= b for a, b in pairwise(image))
    assert image[-1] < 0.5 * image[0]


def test_branches_are_drawn_thick_first_and_rarely_when_late() -> None:
    radius, order = np.array([4.0, 2, 3, 1]), [0, 1, 1, 3]
    rng = np.random.default_rng(0)
    drawn = [draw_branches(radius, order, 4, rng=rng) for _ in range(4000)]
    assert all(one[0] == 0 and one == sorted(one, key=lambda axis: -radius[axis]) for one in drawn)
    share = np.bincount(np.concatenate(drawn)) / len(drawn)
    assert_allclose(share, [1, 1 / 2, 1 / 2, 1 / 4], atol=0.03)


def test_joints_turned_four_times_are_back() -> None:
    points = np.random.default_rng(0).normal(size=(10, 3))
    assert_allclose(turn_about(np.array([[1.0, 2, 0]]), np.array([0.0, 1, 0])), [[0, 2, -1]], atol=1e-12)
    axis = np.array([0.6, 0.8, 0])
    turned = points
    for _ in range(4):
        turned = turn_about(turned, axis)
    assert_allclose(turned, points, atol=1e-12)


def test_distances_of_a_field_only_fall() -> None:
    field = Field(np.array([[0.0, 1, 0], [0, 5, 0]]), np.array([1.0, 5.0]))
    field.grow(np.array([[0.0, 4, 0]]), np.array([[1.0, 4, 0]]))
    assert_allclose(field.distance, [1, 1])
    assert field.cost == pytest.approx(2)


def test_axes_of_a_trunk_with_two_limbs() -> None:
    axes = axes_of(two_limbs(), stem_end(two_limbs(), ball_view()))
    assert [axis.order for axis in axes] == [0, 1, 1]
    assert [axis.bearer for axis in axes] == [-1, 0, 0]
    assert [axis.nodes.tolist() for axis in axes] == [[0, 1, 2, 3, 4, 5, 6, 7], [4, 8, 9, 10], [5, 11, 12]]


def test_densify_keeps_nodes_and_lays_the_others_between() -> None:
    skeleton = two_limbs()
    dense, index = densify(skeleton, 0.3)
    assert_allclose(dense.position[index], skeleton.position, atol=1e-12)
    assert_allclose(dense.radius[index], skeleton.radius)
    assert (np.diff(index) > 0).all()
    step = np.linalg.norm(dense.position[1:] - dense.position[dense.parent[1:]], axis=1)
    assert step.max() < 0.3 * 1.4
    assert densify(dense, 0.5)[1].tolist() == list(range(len(dense)))  # dense enough already


def test_a_straight_branch_stays_straight_when_densified() -> None:
    line = Skeleton(np.array([[0.0, 0, 0], [0, 1, 0], [0, 4, 0]]), np.array([-1, 0, 1]), np.array([3.0, 2, 1]))
    dense, _ = densify(line, 0.5)
    assert_allclose(dense.position[:, [0, 2]], 0, atol=1e-12)
    assert (np.diff(dense.position[:, 1]) > 0).all()
    assert (np.diff(dense.radius) <= 0).all()


def test_directions_are_turned_no_farther_than_wanted() -> None:
    rng = np.random.default_rng(0)
    unit = lambda v: v / np.linalg.norm(v, axis=1, keepdims=True)  # noqa: E731
    wish, axis = unit(rng.normal(size=(100, 3))), unit(rng.normal(size=(100, 3)))
    wish[0] = axis[0]
    low, high = np.full(100, 0.5), np.full(100, 1.0)
    turned = turn_within(wish, axis, low, high)
    angle = np.arccos((turned * axis).sum(axis=1))
    assert_allclose(np.linalg.norm(turned, axis=1), 1)
    assert angle.min() > 0.5 - 1e-9
    assert angle.max() < 1 + 1e-9
    fits = (np.arccos((wish * axis).sum(axis=1)) > 0.5) & (np.arccos((wish * axis).sum(axis=1)) < 1)
    assert_allclose(turned[fits], wish[fits], atol=1e-9)


@pytest.fixture(scope="module")
def grown() -> Skeleton:
    return SubtreeReplacement()(two_limbs(), [ball_view()], rng=stage_rng(1, "grow"))


def test_the_visible_branches_stay(grown: Skeleton) -> None:
    before = two_limbs()
    gap = np.linalg.norm(grown.position[:, None] - before.position, axis=2)
    place = gap.argmin(axis=0)
    assert_allclose(gap.min(axis=0), 0, atol=1e-12)
    assert (np.diff(place) > 0).all()
    assert_allclose(grown.radius[place], before.radius)
    assert np.isnan(grown.radius[place.max() + 1 :]).all()


def test_every_part_of_the_crown_has_wood_near_and_none_leaves_it(grown: Skeleton) -> None:
    volume = crown_volume([ball_view()])
    away, _ = cKDTree(grown.position).query(volume.sample(0.3, stage_rng(2, "probe")))
    assert np.quantile(away, 0.95) < 0.05 * 10  # foliage stands in masses with gaps between
    new = grown.position[two_limbs().position.shape[0] + 40 :]
    volume = crown_volume([ball_view()], is_round=False)  # the silhouette binds; the depth may be lobed
    passes, _ = volume.allows(new)
    assert np.linalg.norm(new - [0, 7, 0], axis=1).max() < 1.35 * 3.2 + 1
    assert passes.mean() > 0.99
    tips = np.bincount(grown.parent[1:], minlength=len(grown)) == 0
    tips[:60] = False
    assert volume.allows(grown.position[tips])[1].mean() > 0.99
    for turned in (grown.position @ _about_y(a) for a in np.radians([0, 45, 90, 135])):
        assert turned[:, 0].min() < -2.4  # from every side out to the rim
        assert turned[:, 0].max() > 2.4


def _about_y(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def test_foliage_has_wood_near_it_in_the_picture(grown: Skeleton) -> None:
    view = ball_view()
    rows, columns = np.nonzero(view.mattes.is_foliage)
    away, _ = cKDTree(view.camera.project(grown.position)).query(np.column_stack([columns, rows]) + 0.5)
    assert np.quantile(away, 0.98) / (10 * PX) < 0.02


def test_branches_get_shorter_outward_and_nothing_grows_on_the_bare_trunk(grown: Skeleton) -> None:
    axes = axes_of(grown)
    length = np.array([np.linalg.norm(np.diff(grown.position[a.nodes], axis=0), axis=1).sum() for a in axes])
    order = np.array([a.order for a in axes])
    means = [length[order == k].mean() for k in range(1, 4)]
    assert means[0] > means[1] > means[2]
    start = grown.position[[a.nodes[0] for a in axes[1:]]]
    assert start[:, 1].min() > 2.0
    assert 500 < len(grown) < 30000


def test_same_seed_same_tree_and_another_seed_another(grown: Skeleton) -> None:
    again = SubtreeReplacement()(two_limbs(), [ball_view()], rng=stage_rng(1, "grow"))
    other = SubtreeReplacement()(two_limbs(), [ball_view()], rng=stage_rng(2, "grow"))
    assert grown.position.tobytes() == again.position.tobytes()
    assert grown.parent.tobytes() == again.parent.tobytes()
    assert grown.position.tobytes() != other.position.tobytes()


def test_the_papers_setting_takes_exactly_its_iterations_and_keeps_to_the_foliage() -> None:
    steps = []
    tree = PAPER(
        two_limbs(), [ball_view()], rng=stage_rng(0, "grow"), on_step=lambda done, total, _: steps.append((done, total))
    )
    assert steps == [(k, 20) for k in range(1, 21)]
    assert len(tree) > 100


def test_the_papers_values_are_the_printed_ones() -> None:
    paper = SubtreeReplacement.paper()
    assert (paper.iterations, paper.n_rotations, paper.n_subtrees) == (100, 12, 8)
    assert (paper.patience, paper.twigs, paper.round_crown) == (0, False, False)


def test_only_the_users_subtrees_can_be_used(tmp_path) -> None:
    source = (PREDEFINED / "along_upright.json").read_text()
    (tmp_path / "mine.json").write_text(source)
    own = replace(PAPER, visible_subtrees=False, predefined_subtrees=False, library=str(tmp_path))
    tree = own(two_limbs(), [ball_view()], rng=stage_rng(0, "grow"))
    assert len(tree) > 50


def test_the_form_is_measured() -> None:
    cone, ball = crown_volume([cone_view()]).turned, crown_volume([ball_view()]).turned
    assert cone is not None
    assert ball is not None
    trunk = two_limbs().position[:8]
    assert growth_form(trunk, cone) == "excurrent"
    assert growth_form(trunk, ball) == "decurrent"


def test_a_conifers_stem_is_carried_to_its_top() -> None:
    outline = crown_volume([cone_view()]).turned
    assert outline is not None
    trunk = two_limbs().position[:8]
    points = leader(trunk, outline, 10.0)
    assert points[-1, 1] == pytest.approx(9.9, abs=0.15)
    assert abs(points[-1, 0]) < 0.15
    assert (np.diff(points[:, 1]) > 0).all()
    assert not len(leader(np.array([[0.0, 0, 0], [0, 9.9, 0]]), outline, 10.0))


def test_a_conifer_has_one_stem_and_longer_branches_below() -> None:
    tree = SubtreeReplacement()(two_limbs(4.0), [cone_view()], rng=stage_rng(1, "grow"))
    top = int(tree.position[:, 1].argmax())
    axes = axes_of(tree, top)
    stem = tree.position[axes[0].nodes]
    assert stem[-1, 1] > 9.5
    assert np.abs(stem[:, [0, 2]]).max() < 0.5
    reach = height_above_tips(tree.position, tree.parent)
    side = np.array([(tree.position[a.nodes[0], 1], reach[a.nodes[1]]) for a in axes[1:] if a.bearer == 0])
    low, high = side[side[:, 0] < 5], side[side[:, 0] > 7]
    assert len(low) > 8
    assert low[:, 1].mean() > 1.5 * high[:, 1].mean()
