"""build_tree: the stages in their order, on the drawn tree of known truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace

import numpy as np
import pytest

from forestgen.errors import StageError
from forestgen.tree.build import Source, build_tree
from forestgen.tree.methods import METHODS, STAGES, Method, configure
from forestgen.tree.model import TreeModel
from tests.synthetic import DrawnTree, drawn_tree

HEIGHT = 5.5  # m
QUICK = {"iterations": 10, "least_twigs": 200, "most_twigs": 200, "most": 500}
UNBOUNDED = {  # what the papers print lets these leave the crown
    "kim2014_paper": "grafted units know no crown",
    "neubert2007_paper": "plain matting keeps some of the drawn sky, and biomass there",
}
ORDER = ("segment", "trace", "lift", "radius", "grow", "bark", "mesh", "atlas", "leaves")


@pytest.fixture(scope="module")
def drawn() -> DrawnTree:
    return drawn_tree(px_per_metre=40.0)


def few(name: str, stages: Mapping[str, str] | None = None) -> Method:
    """A method with less to do, where its stages have such fields."""
    grow = configure(name, stages or {}, {}).grow
    settings = {field.name: QUICK[field.name] for field in fields(grow) if field.name in QUICK}
    return configure(name, stages or {}, {"grow": settings, "leaves": {"most": 2000}})


def build(drawn: DrawnTree, method: Method, seed: int = 3) -> TreeModel:
    return build_tree([Source(drawn.photo, drawn.strokes)], method, name="drawn", height=HEIGHT, seed=seed)


def bytes_of(model: TreeModel) -> dict[str, bytes]:
    """The arrays that are written, each as bytes."""
    return {
        "skeleton": model.skeleton.position.tobytes(),
        "radius": model.skeleton.radius.tobytes(),
        "mesh": model.mesh.points.tobytes(),
        "uv": model.mesh.uv.tobytes(),
        "leaves": model.leaves.position.tobytes(),
        "turns": model.leaves.orientation.tobytes(),
        "atlas": model.atlas.rgba.tobytes(),
        "bark": model.bark.rgb.tobytes(),
        **{f"cost {name}": cost.tobytes() for name, cost in model.costs.items()},
    }


@pytest.mark.parametrize("name", sorted(METHODS))
def test_every_method_builds_the_drawn_tree(name: str, drawn: DrawnTree) -> None:
    model = build(drawn, few(name))
    assert model.height == HEIGHT
    assert model.skeleton.position[:, 1].max() > 0.7 * HEIGHT
    foot = model.mesh.points[model.mesh.points[:, 1] < 0.05]
    assert np.linalg.norm(foot[:, [0, 2]], axis=1).min() < 0.3  # it stands on its root
    if name not in UNBOUNDED:
        assert model.skeleton.position[:, 1].max() < 1.1 * HEIGHT
        assert np.abs(foot[:, [0, 2]]).max() < 1.0
    assert len(model.leaves) > 20
    assert np.all(np.diff(model.leaves.prototype) >= 0)  # kept in the order that stores well
    assert list(model.seconds) == list(STAGES)
    assert all(0 < len(cost) <= QUICK["iterations"] for cost in model.costs.values())
    assert model.notes == ()


def test_a_seed_decides_everything_and_stages_report_in_order(drawn: DrawnTree) -> None:
    heard: list[str] = []
    method = few("tan2008")
    one = build_tree(
        [Source(drawn.photo, drawn.strokes)],
        method,
        height=HEIGHT,
        seed=3,
        on_stage=lambda stage, done, total: heard.append(stage),
    )
    assert sorted(set(heard), key=heard.index) == list(ORDER)
    assert bytes_of(one) == bytes_of(build(drawn, method))
    other = bytes_of(build(drawn, method, seed=4))
    assert bytes_of(one)["skeleton"] != other["skeleton"]


def test_a_mixture_of_methods_builds(drawn: DrawnTree) -> None:
    mixed = few("tan2008_paper", {"trace": "smooth_paths", "radius": "measured_taper"})
    assert len(build(drawn, mixed).skeleton) > 30


def test_a_bare_tree_says_so() -> None:
    drawn = drawn_tree(leaves=False, px_per_metre=40.0)
    method = few("tan2008")
    model = build(drawn, replace(method, segment=replace(method.segment, bare="yes")))
    assert len(model.leaves) == 0
    assert "bare tree" in model.notes[0]


def test_two_views_defeat_a_single_view_method(drawn: DrawnTree) -> None:
    with pytest.raises(StageError, match="one"):
        build_tree([Source(drawn.photo, drawn.strokes)] * 2, few("tan2008"), height=HEIGHT)
