"""Methods: the printed values, configuring by name, mixtures, and every strategy's contract."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any, get_type_hints

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.arrays import stage_rng
from forestgen.errors import InputError, StageError
from forestgen.tree.branches import BranchGraph
from forestgen.tree.grow.subtree_replacement import SubtreeReplacement
from forestgen.tree.lift.spread_branches import SpreadBranches
from forestgen.tree.mattes import Mattes
from forestgen.tree.methods import METHODS, STAGES, STRATEGIES, Method, configure
from forestgen.tree.model import Atlas, Bark, Leaves, Mesh
from forestgen.tree.radius import ConstantRatio, MeasuredTaper
from forestgen.tree.segment.graph_cut import GraphCutFoliage
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import Strategy
from forestgen.tree.trace.circle_tracing import CircleTracing
from forestgen.tree.trace.smooth_paths import SmoothPaths
from tests.synthetic import DrawnTree, drawn_tree

# What the papers print, by stage and field: (value, section).
PRINTED: dict[str, dict[str, dict[str, tuple[object, str]]]] = {
    "tan2008_paper": {
        "segment": {
            "components": (10, "2, 'a mixture of 10 Gaussians'"),
            "leaf_components": (4, "2, 'the four most green or red Gaussian components'"),
            "smoothness": (60.0, "2, 'is set to 60 in our implementation'"),
            "dilations": (10, "2, 'by morphology expansion 10 times'"),
            "rule": ("green_red", "2"),
        },
        "trace": {
            "n_branch": (5, "2, 'Typically, 5 Gaussian distributions'"),
            "n_other": (5, "2, the same"),
            "circle_px": (50.0, "2, '50 pixels', 'image resolution at about 1500 pixels'"),
            "least_turn_deg": (30.0, "2, '(< 30 degrees)'"),
        },
        "grow": {
            "iterations": (100, "3.1, 'iteratively about 100 times'"),
            "n_rotations": (12, "3.1, '12 quantized levels'"),
            "n_subtrees": (8, "3.1, 'with only at most 8 subtrees'"),
            "whole_branches": (True, "3.1"),
            "visible_subtrees": (True, "3.1"),
            "predefined_subtrees": (True, "3.1"),
            "patience": (0, "no early end is printed"),
            "min_gain": (0.0, "none is printed"),
            "shortest": (0.0, "none is printed"),
            "round_crown": (False, "no such step is printed"),
            "leaf_masses": (False, "no such step is printed"),
            "leader": (False, "no such step is printed"),
            "twigs": (False, "no such step is printed"),
        },
        "radius": {"ratio": (0.75, "2, '75% of its parent'")},
        "leaves": {
            "size_rule": ("trunk", "4"),
            "trunk_share": (0.1, "4, '1/10 of the main trunk radius'"),
            "number_rule": ("branch", "4"),
            "fewest_per_branch": (50, "4, 'a range of 50 to 200 leaves'"),
            "most_per_branch": (200, "4, 'a range of 50 to 200 leaves'"),
            "inside": (1.0, "4, 'inside the foliage region'"),
            "divergence_spread_deg": (360.0, "4, 'randomized'"),
            "size_spread": (0.0, "none is printed"),
            "tries": (1, "no second try is printed"),
            "fill_rounds": (0, "none is printed"),
        },
    },
    "neubert2007_paper": {
        "segment": {"pull": (0.0, "4, plain alpha matting"), "open_sky": (False, "no such step is printed")},
        "lift": {
            "particles": (1000, "9, '1000-2000 particles'; 6, 'between 500 and 1000' for medium-sized trees"),
            "steps": (200, "9, '200 iterations'"),
            "field_resolution": (100, "7, 'a grid of 100 by 100'"),
            "density_resolution": (25, "5, 'typically 25 x 25 x 25 voxels'"),
            "density_prior": (False, "no such step is printed"),
            "visible_limbs": (False, "no such step is printed"),
            "blend": ("linear", "7, 'the mostly used case'"),
        },
        "grow": {
            "divergence_deg": (137.5, "8, 'about 137.5'"),
            "complete": (False, "no such step is printed"),
            "density_resolution": (25, "5"),
        },
        "radius": {
            "exponent": (2.0, "8, r^2 = a * sum of r_i^2"),
            "constant": (1.0, "8, 'a is a constant'; not given"),
            "measured": (False, "8: by the number of particles alone"),
        },
        "leaves": {
            "density_resolution": (25, "5"),
            "tries": (1, "no second try is printed"),
            "fill_rounds": (0, "none is printed"),
        },
    },
    "kim2014_paper": {
        "segment": {
            "radius": (1, "figure 2, '3x3 window'"),
            "pull": (0.0, "II.1, equation 3 alone"),
            "open_sky": (False, "no such step is printed"),
        },
        "lift": {"neighbours_apart": (False, "II.3, the angle of sub-branch i")},
        "grow": {
            "levels": (3, "figure 7, '2-4 level'"),
            "inside_crown": (False, "no such step is printed"),
            "complete": (False, "no such step is printed"),
            "leaf_masses": (False, "no such step is printed"),
        },
        "radius": {"slender": (0.0, "no such step is printed")},
    },
}


@pytest.mark.parametrize(
    ("method", "stage", "name", "value"),
    [
        (method, stage, name, value)
        for method, stages in PRINTED.items()
        for stage, table in stages.items()
        for name, (value, _) in table.items()
    ],
)
def test_the_papers_setting_keeps_what_is_printed(method: str, stage: str, name: str, value: object) -> None:
    assert getattr(getattr(METHODS[method], stage), name) == value


def test_the_papers_strategies() -> None:
    paper = METHODS["tan2008_paper"]
    assert isinstance(paper.segment, GraphCutFoliage)
    assert isinstance(paper.trace, CircleTracing)
    assert isinstance(paper.lift, SpreadBranches)
    assert isinstance(paper.radius, ConstantRatio)
    assert paper.grow == SubtreeReplacement.paper()


def strategies() -> Iterator[tuple[str, str, Any]]:
    """(stage, name, strategy) of all registered ones, and of every method's."""
    for stage, table in STRATEGIES.items():
        for name, strategy in table.items():
            yield stage, name, strategy
    for method_name, method in METHODS.items():
        for stage in STAGES:
            yield stage, method_name, getattr(method, stage)


def of_stage(stage: str) -> list[Any]:
    """The different strategies of one stage, as parameters of a test."""
    found = {repr(strategy): pytest.param(strategy, id=name) for s, name, strategy in strategies() if s == stage}
    return list(found.values())


@pytest.mark.parametrize("strategy", [pytest.param(s, id=f"{stage}-{name}") for stage, name, s in strategies()])
def test_strategies_are_frozen_and_plain(strategy: Any) -> None:
    assert isinstance(strategy, Strategy)
    assert is_dataclass(strategy)
    name = fields(strategy)[0].name if fields(strategy) else "anything"
    with pytest.raises(AttributeError):
        setattr(strategy, name, 1)
    for field in fields(strategy):  # a manifest writes them down
        assert isinstance(getattr(strategy, field.name), bool | int | float | str), field.name
    assert set(get_type_hints(type(strategy))) >= {field.name for field in fields(strategy)}
    assert pickle.loads(pickle.dumps(strategy)) == strategy  # workers are sent it


def test_every_stage_has_a_choice_of_strategies() -> None:
    assert set(STRATEGIES) == set(STAGES) == {field.name for field in fields(Method)}
    assert configure("tan2008", {}, {}) == METHODS["tan2008"]


@pytest.mark.parametrize(
    ("name", "stages", "settings", "message"),
    [
        ("tan2009", {}, {}, "unknown method 'tan2009'; did you mean 'tan2008'?"),
        ("xyz", {}, {}, "unknown method 'xyz'; choose from .*tan2008, tan2008_paper"),
        ("tan2008", {"traces": "smooth_paths"}, {}, "unknown stage 'traces'; did you mean 'trace'?"),
        ("tan2008", {"trace": "smooth_path"}, {}, "unknown strategy of stage 'trace' 'smooth_path'; did you mean"),
        ("tan2008", {}, {"grew": {}}, "unknown stage 'grew'; did you mean 'grow'?"),
        ("tan2008", {}, {"grow": {"iteration": 5}}, "unknown setting of stage 'grow' 'iteration'; did you mean"),
        ("tan2008", {}, {"grow": {"iterations": "many"}}, "settings.grow.iterations: .*came 'many'"),
        ("tan2008", {}, {"grow": {"iterations": 1.5}}, "settings.grow.iterations: .*came 1.5"),
        ("tan2008", {}, {"grow": {"twigs": 7}}, "settings.grow.twigs: .*came 7"),
        ("tan2008", {}, {"segment": {"rule": "blue"}}, "settings.segment.rule: .*came 'blue'"),
        ("tan2008", {}, {"leaves": {"size": 0.0}}, "settings.leaves.*size is 0.0; expected at least"),
        ("tan2008", {}, {"leaves": {"inside": 2.0}}, "settings.leaves.*inside is 2.0; expected a share"),
        # A setting belongs to the strategy in use: the circle is the paper's.
        ("tan2008", {}, {"trace": {"circle_px": 40.0}}, "unknown setting of stage 'trace' 'circle_px'"),
    ],
)
def test_configure_says_what_is_wrong(
    name: str, stages: dict[str, str], settings: dict[str, dict[str, object]], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        configure(name, stages, settings)


def test_configure_puts_settings_in() -> None:
    method = configure("tan2008", {}, {"grow": {"iterations": 5, "interval": 0.05}, "leaves": {"most": 10}})
    assert method.grow == replace(METHODS["tan2008"].grow, iterations=5, interval=0.05)
    assert method.leaves.most == 10
    assert method.segment == METHODS["tan2008"].segment
    assert METHODS["tan2008"].grow.iterations != 5  # the registry's own stays


def test_configure_mixes_methods() -> None:
    mixed = configure("tan2008_paper", {"trace": "smooth_paths"}, {"trace": {"turn": 0.2}})
    assert mixed.trace == SmoothPaths(turn=0.2)
    assert mixed.grow == METHODS["tan2008_paper"].grow


def test_whole_numbers_do_for_decimals() -> None:
    assert configure("tan2008", {}, {"segment": {"smoothness": 4}}).segment.smoothness == 4.0


# Each stage on the drawn tree: the contract holds, inputs stay, the same seed gives the same bytes.


QUICK = {"iterations": 20, "least_twigs": 300, "most_twigs": 300, "most": 3000}  # enough of each to see the contract


def quick(strategy: Any) -> Any:
    """The strategy with less to do, where it has such a field."""
    return replace(strategy, **{field.name: QUICK[field.name] for field in fields(strategy) if field.name in QUICK})


@pytest.fixture(scope="module")
def tree() -> DrawnTree:
    return drawn_tree(px_per_metre=40.0)


@pytest.fixture(scope="module")
def skeleton(tree: DrawnTree) -> Skeleton:
    return MeasuredTaper()(SpreadBranches()([tree.view], rng=stage_rng(1, "lift")), [tree.view])


@pytest.fixture(scope="module")
def grown(tree: DrawnTree, skeleton: Skeleton) -> Skeleton:
    grow = quick(SubtreeReplacement())
    return MeasuredTaper()(grow(skeleton, [tree.view], rng=stage_rng(1, "grow")), [tree.view])


@pytest.fixture(scope="module")
def atlas(tree: DrawnTree) -> Atlas:
    made: Atlas = METHODS["tan2008"].atlas([tree.view], rng=stage_rng(1, "atlas"))
    return made


def same(one: Any, other: Any) -> bool:
    """Whether two results hold the same bytes."""
    return pickle.dumps(one) == pickle.dumps(other)


def run_twice(strategy: Any, *inputs: Any, seeded: bool = True) -> Any:
    """What a strategy gives: the same both times, and nothing of what came in has changed."""
    before = pickle.dumps(inputs)
    extra = [{"rng": stage_rng(1, "stage")} if seeded else {} for _ in range(2)]
    first, second = strategy(*inputs, **extra[0]), strategy(*inputs, **extra[1])
    assert pickle.dumps(inputs) == before
    assert same(first, second)
    return first


def assert_rooted(skeleton: Skeleton, *, has_radius: bool = False) -> None:
    assert skeleton.parent[0] == -1
    assert (skeleton.parent[1:] < np.arange(1, len(skeleton))).all()
    assert np.isfinite(skeleton.position).all()
    if has_radius:
        assert np.isfinite(skeleton.radius).all()
        assert (skeleton.radius > 0).all()


@pytest.mark.parametrize("strategy", of_stage("segment"))
def test_every_segmenter_fills_both_mattes(strategy: Any, tree: DrawnTree) -> None:
    mattes = run_twice(strategy, tree.photo, tree.strokes)
    assert isinstance(mattes, Mattes)
    assert mattes.foliage.shape == tree.photo.rgb.shape[:2]
    assert mattes.is_foliage.any()
    assert mattes.is_branch.any()
    assert (mattes.foliage + mattes.branch <= 1 + 1e-5).all()  # a pixel is not leaf and wood at once


@pytest.mark.parametrize("strategy", of_stage("trace"))
def test_every_tracer_starts_at_the_root(strategy: Any, tree: DrawnTree) -> None:
    graph = run_twice(strategy, tree.photo, tree.strokes, tree.mattes)
    assert isinstance(graph, BranchGraph)
    assert_allclose(graph.xy[0], tree.strokes.root, atol=0.05 * tree.photo.size[1])
    assert np.isfinite(graph.xy).all()
    assert np.nanmax(graph.radius_px) > 1
    assert ((graph.xy >= 0) & (graph.xy <= tree.photo.size)).all()


@pytest.mark.parametrize("strategy", of_stage("lift"))
def test_every_lift_stands_on_its_root_and_has_depth(strategy: Any, tree: DrawnTree) -> None:
    lifted = run_twice(strategy, [tree.view])
    assert_rooted(lifted)
    assert np.ptp(lifted.position[:, 2]) > 0.3  # it left the photo's plane
    drawn = tree.camera.project(lifted.position)
    away = np.linalg.norm(drawn[:, None] - tree.branches.xy[None], axis=2).min(axis=0)
    assert np.median(away) < 0.02 * tree.photo.size[1]  # px: what was traced is there


@pytest.mark.parametrize("strategy", [p for p in of_stage("lift") if p.values[0].most_views == 1])
def test_lifts_of_one_view_project_to_its_trace_and_refuse_two(strategy: Any, tree: DrawnTree) -> None:
    lifted = strategy([tree.view], rng=stage_rng(1, "lift"))
    assert_allclose(tree.camera.project(lifted.position), tree.branches.xy, atol=1e-9)
    assert_array_equal(lifted.parent, tree.branches.parent)
    with pytest.raises(StageError):
        strategy([tree.view, tree.view], rng=stage_rng(1, "lift"))


@pytest.mark.parametrize("strategy", of_stage("grow"))
def test_every_grower_keeps_the_visible_branches(strategy: Any, tree: DrawnTree, skeleton: Skeleton) -> None:
    grown = run_twice(quick(strategy), skeleton, [tree.view])
    assert_rooted(grown)
    assert len(grown) > len(skeleton)
    drawn, traced = (tree.camera.project(one.position) for one in (grown, skeleton))
    gap = np.linalg.norm(drawn[:, None] - traced[None], axis=2).min(axis=0)
    assert gap.max() < 1e-6  # px: in the photo they stand where they were traced
    other = quick(strategy)(skeleton, [tree.view], rng=stage_rng(2, "stage"))
    assert not same(grown, other)


@pytest.mark.parametrize("strategy", of_stage("radius"))
def test_every_radius_thins_outwards(strategy: Any, tree: DrawnTree, grown: Skeleton) -> None:
    bare = replace(grown, radius=np.where(np.arange(len(grown)) < 4, 0.15, np.nan))
    thick = run_twice(strategy, bare, [tree.view], seeded=False)
    assert_rooted(thick, has_radius=True)
    assert (thick.radius[1:] <= thick.radius[thick.parent[1:]] + 1e-12).all()
    assert_array_equal(thick.position, grown.position)
    assert_array_equal(thick.parent, grown.parent)


@pytest.mark.parametrize("strategy", of_stage("bark"))
def test_every_bark_is_a_picture_with_a_size(strategy: Any, tree: DrawnTree) -> None:
    bark = run_twice(strategy, [tree.view])
    assert isinstance(bark, Bark)
    assert bark.width_m > 0
    assert bark.height_m > 0


@pytest.mark.parametrize("strategy", of_stage("mesh"))
def test_every_mesh_is_closed(strategy: Any, grown: Skeleton) -> None:
    mesh = run_twice(strategy, grown, Bark(np.zeros((1, 1, 3), np.uint8), 1.0, 1.0), seeded=False)
    assert isinstance(mesh, Mesh)
    assert np.isfinite(mesh.points).all()
    assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-6)
    place, corner = np.unique(np.round(mesh.points, 7), axis=0, return_inverse=True)
    faces = corner.reshape(-1)[mesh.faces]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = edges[edges[:, 0] != edges[:, 1]]
    code, back = (np.sort(e @ [len(place), 1]) for e in (edges, edges[:, ::-1]))
    assert_array_equal(code, back)  # each edge is passed as often one way as the other


@pytest.mark.parametrize("strategy", of_stage("atlas"))
def test_every_atlas_has_leaves_inside_it(strategy: Any, tree: DrawnTree) -> None:
    atlas = run_twice(strategy, [tree.view])
    assert isinstance(atlas, Atlas)
    assert len(atlas.prototypes) >= 1
    for leaf in atlas.prototypes:
        assert 0 <= leaf.uv.min() <= leaf.uv.max() <= 1
        assert leaf.faces.max() < len(leaf.points)
        assert len(leaf.points) > 4  # trimmed to the leaf, no bare square


@pytest.mark.parametrize("strategy", of_stage("leaves"))
def test_all_leaves_hang_inside_the_foliage(strategy: Any, tree: DrawnTree, grown: Skeleton, atlas: Atlas) -> None:
    leaves = run_twice(quick(strategy), grown, [tree.view], atlas)
    assert isinstance(leaves, Leaves)
    assert 20 < len(leaves) <= QUICK["most"]
    assert (leaves.size > 0).all()
    assert leaves.prototype.max() < len(atlas.prototypes)
    column, row = np.floor(tree.camera.project(leaves.position)).astype(int).T
    tall, wide = tree.mattes.foliage.shape
    assert ((column >= 0) & (column < wide) & (row >= 0) & (row < tall)).all()
    other = quick(strategy)(grown, [tree.view], atlas, rng=stage_rng(2, "stage"))
    assert not same(leaves, other)
