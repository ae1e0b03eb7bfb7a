"""Methods: one strategy a stage. The only file that names all the papers.

A method's plain name is our best setting of it; NAME_paper keeps every value that the paper prints.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from difflib import get_close_matches
from typing import Any

from pydantic import TypeAdapter, ValidationError

from forestgen.errors import InputError
from forestgen.tree.atlas import LeafAtlasFromPhoto
from forestgen.tree.bark import BarkFromPhoto
from forestgen.tree.contracts import MakeAtlas, MakeBark, MakeMesh, PlaceLeaves, Radius
from forestgen.tree.da_vinci import DaVinci
from forestgen.tree.foliage import LeavesAlongBranches
from forestgen.tree.grow import Grow
from forestgen.tree.grow.grafting import Grafting
from forestgen.tree.grow.phyllotaxis import PhyllotaxisTwigs
from forestgen.tree.grow.subtree_replacement import SubtreeReplacement
from forestgen.tree.leaves_by_density import LeavesByDensity
from forestgen.tree.lift import Lift
from forestgen.tree.lift.gaussian_azimuth import GaussianAzimuth
from forestgen.tree.lift.particle_flow import ParticleFlow
from forestgen.tree.lift.spread_branches import SpreadBranches
from forestgen.tree.measured_width import MeasuredWidth
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.radius import ConstantRatio, MeasuredTaper
from forestgen.tree.segment import Segment
from forestgen.tree.segment.closed_form import ClosedFormMatte
from forestgen.tree.segment.graph_cut import GraphCutFoliage
from forestgen.tree.segment.normalized_matte import NormalizedMatte
from forestgen.tree.trace import Trace
from forestgen.tree.trace.circle_tracing import CircleTracing
from forestgen.tree.trace.live_wire import LiveWire
from forestgen.tree.trace.pruned_skeleton import PrunedSkeleton
from forestgen.tree.trace.smooth_paths import SmoothPaths


@dataclass(frozen=True, kw_only=True)
class Method:
    """One strategy for each stage, in the order in which they run."""

    segment: Segment
    trace: Trace
    lift: Lift
    grow: Grow
    radius: Radius
    bark: MakeBark
    mesh: MakeMesh
    atlas: MakeAtlas
    leaves: PlaceLeaves


TAN_2008 = Method(
    segment=GraphCutFoliage(),
    trace=SmoothPaths(),
    lift=SpreadBranches(),
    grow=SubtreeReplacement(),
    radius=MeasuredTaper(),
    bark=BarkFromPhoto(),
    mesh=GeneralisedCylinders(),
    atlas=LeafAtlasFromPhoto(),
    leaves=LeavesAlongBranches(),
)
TAN_2008_PAPER = replace(
    TAN_2008,
    segment=GraphCutFoliage(rule="green_red", smoothness=60.0),
    trace=CircleTracing(),
    grow=SubtreeReplacement.paper(),
    radius=ConstantRatio(),
    leaves=LeavesAlongBranches(
        size_rule="trunk",
        number_rule="branch",
        size_spread=0.0,
        tries=1,
        fill_rounds=0,
        divergence_spread_deg=360.0,
        inside=1.0,
    ),
)
NEUBERT_2007 = replace(
    TAN_2008,
    lift=ParticleFlow(),
    grow=PhyllotaxisTwigs(),
    radius=DaVinci(),
    leaves=LeavesByDensity(),
)
NEUBERT_2007_PAPER = replace(
    NEUBERT_2007,
    segment=ClosedFormMatte(pull=0.0, open_sky=False),
    trace=LiveWire(seeds="both"),
    lift=ParticleFlow.paper(),
    grow=PhyllotaxisTwigs.paper(),
    radius=DaVinci(measured=False, slender=0.0),
    leaves=LeavesByDensity(density_resolution=25, tries=1, fill_rounds=0),
)
KIM_2014 = replace(
    TAN_2008,
    trace=PrunedSkeleton(),
    lift=GaussianAzimuth(),
    grow=Grafting(),
    radius=MeasuredWidth(),
)
KIM_2014_PAPER = replace(
    KIM_2014,
    segment=NormalizedMatte(pull=0.0, open_sky=False),
    lift=GaussianAzimuth(neighbours_apart=False),
    grow=Grafting.paper(),
    radius=MeasuredWidth(slender=0.0),
)
METHODS = {
    "tan2008": TAN_2008,
    "tan2008_paper": TAN_2008_PAPER,
    "neubert2007": NEUBERT_2007,
    "neubert2007_paper": NEUBERT_2007_PAPER,
    "kim2014": KIM_2014,
    "kim2014_paper": KIM_2014_PAPER,
}

STAGES = tuple(field.name for field in fields(Method))

STRATEGIES: Mapping[str, Mapping[str, Any]] = {
    "segment": {
        "graph_cut": GraphCutFoliage(),
        "closed_form": ClosedFormMatte(),
        "normalized_matte": NormalizedMatte(),
    },
    "trace": {
        "circle_tracing": CircleTracing(),
        "smooth_paths": SmoothPaths(),
        "live_wire": LiveWire(),
        "pruned_skeleton": PrunedSkeleton(),
    },
    "lift": {
        "spread_branches": SpreadBranches(),
        "particle_flow": ParticleFlow(),
        "gaussian_azimuth": GaussianAzimuth(),
    },
    "grow": {
        "subtree_replacement": SubtreeReplacement(),
        "phyllotaxis": PhyllotaxisTwigs(),
        "grafting": Grafting(),
    },
    "radius": {
        "constant_ratio": ConstantRatio(),
        "measured_taper": MeasuredTaper(),
        "da_vinci": DaVinci(),
        "measured_width": MeasuredWidth(),
    },
    "bark": {"from_photo": BarkFromPhoto()},
    "mesh": {"generalised_cylinders": GeneralisedCylinders()},
    "atlas": {"from_photo": LeafAtlasFromPhoto()},
    "leaves": {"along_branches": LeavesAlongBranches(), "by_density": LeavesByDensity()},
}


def configure(name: str, stages: Mapping[str, str], settings: Mapping[str, Mapping[str, object]]) -> Method:
    """The method of that name with other strategies and settings put in, by stage name.

    Raises:
        InputError: unknown method, stage, strategy or field, or a value of the wrong type.
    """
    method = METHODS[_known(name, METHODS, "method")]
    for stage, strategy in stages.items():
        choices = STRATEGIES[_known(stage, STAGES, "stage")]
        method = replace(method, **{stage: choices[_known(strategy, choices, f"strategy of stage '{stage}'")]})
    for stage, table in settings.items():
        default = getattr(method, _known(stage, STAGES, "stage"))
        method = replace(method, **{stage: _override(default, table, stage)})
    return method


def _override(default: Any, table: Mapping[str, object], stage: str) -> Any:
    """A copy of a strategy with the fields of a table put in."""
    known = [field.name for field in fields(default)]
    for key in table:
        _known(key, known, f"setting of stage '{stage}'")
    try:
        return TypeAdapter(type(default)).validate_python(asdict(default) | dict(table))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "?"
        raise InputError(f"settings.{stage}.{where}: {first['msg']}; came {first['input']!r}") from error
    except ValueError as error:  # a strategy's own check of its fields
        raise InputError(f"settings.{stage}: {error}") from error


def _known(key: str, choices: Any, what: str) -> str:
    if key in choices:
        return key
    near = get_close_matches(key, list(choices), 1)
    hint = f"did you mean '{near[0]}'?" if near else f"choose from {', '.join(sorted(choices))}"
    raise InputError(f"unknown {what} '{key}'; {hint}")
