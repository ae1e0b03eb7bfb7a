"""The papers' settings keep every printed value."""

from __future__ import annotations

import pytest

from forestgen.tree.grow.subtree_replacement import SubtreeReplacement
from forestgen.tree.lift.spread_branches import SpreadBranches
from forestgen.tree.methods import METHODS
from forestgen.tree.radius import ConstantRatio
from forestgen.tree.segment.graph_cut import GraphCutFoliage
from forestgen.tree.trace.circle_tracing import CircleTracing

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
