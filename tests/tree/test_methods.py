"""Methods: configuring by name, mixtures, and every strategy's contract."""

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
from forestgen.tree.radius import MeasuredTaper
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import Strategy
from forestgen.tree.trace.smooth_paths import SmoothPaths
from tests.synthetic import DrawnTree, drawn_tree


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
