"""The tables of scene.toml as a person writes them: keys, types, units and limits."""

from __future__ import annotations

from typing import Annotated, Any

from annotated_types import Ge, Gt, Le, Len, MaxLen, Predicate
from pydantic import Field

from forestgen.reading import Table

DEFAULT_METHOD = "tan2008"


def is_visible_name(text: str) -> bool:
    """Whether a name shows something, and holds no control characters."""
    return bool(text.strip()) and not any(ord(c) < 32 or 127 <= ord(c) < 160 for c in text)


Name = Annotated[str, Predicate(is_visible_name)]
Seed = Annotated[int, Ge(0), Le(2**63 - 1)]
Metres = Annotated[float, Ge(-1e7), Le(1e7)]
Degrees = Annotated[float, Ge(-36000), Le(36000)]
Factor = Annotated[float, Ge(1e-3), Le(1e3)]
Share = Annotated[float, Ge(0), Le(1)]

NAME = "a name in quotes, any Unicode but control characters"
SEED = "a whole number, 0 or more"
METHOD = "a method's name in quotes, such as 'tan2008'"
POSITION = "three numbers [x, y, z] in metres, such as [8.0, 0.0, -2.5]"
HEADING = "degrees about +Y, a number"
PHOTO = "the photo's path in quotes, relative to the manifest"
STROKES = "the stroke set's path in quotes, relative to the manifest"
FACTOR = "a number above 0 (0.001 to 1000)"


class GateTable(Table):
    """Thresholds of the measures of fidelity; what is not named keeps its default."""

    envelope_iou: Share | None = Field(default=None, description="the least that passes, 0 to 1")
    silhouette_iou: Share | None = Field(default=None, description="the least that passes, 0 to 1")
    skill: Annotated[float, Ge(-1), Le(1)] | None = Field(default=None, description="the least that passes, -1 to 1")
    boundary_f: Share | None = Field(default=None, description="the least that passes, 0 to 1")
    branch_chamfer: Share | None = Field(
        default=None, description="the most that passes, as a share of the tree's height: 0.015 for 1.5 %"
    )
    gap_recall: Share | None = Field(default=None, description="the least that passes, 0 to 1")
    density_correlation: Annotated[float, Ge(-1), Le(1)] | None = Field(
        default=None, description="the least that passes, -1 to 1"
    )
    colour_delta_e: Annotated[float, Ge(0)] | None = Field(default=None, description="the most that passes, 0 or more")

    def named(self) -> dict[str, float]:
        """Only the gates that were written down."""
        return self.model_dump(exclude_none=True)


class ViewTable(Table):
    photo: str = Field(description=PHOTO)
    strokes: str = Field(description=STROKES)
    azimuth: Degrees = Field(default=0.0, description="degrees by which the camera has moved about +Y, anticlockwise")
    elevation: Annotated[float, Ge(-90), Le(90)] = Field(
        default=0.0, description="degrees above the horizon, -90 to 90"
    )
    scale: Factor = Field(default=1.0, description=f"a factor on the pixels per metre, {FACTOR}")
    root: Annotated[list[float], Len(2, 2)] | None = Field(default=None, description="the tree's foot [x, y] in pixels")
    focal_px: Annotated[float, Gt(0)] | None = Field(default=None, description="the focal length in pixels, above 0")


class TreeTable(Table):
    name: Name = Field(description=NAME)
    height: Annotated[float, Ge(0.01), Le(1000)] = Field(
        description="metres from the root to the crown's top, a number from 0.01 to 1000"
    )
    photo: str | None = Field(default=None, description=PHOTO)
    strokes: str | None = Field(default=None, description=STROKES)
    view: Annotated[list[ViewTable], MaxLen(99)] = Field(
        default=[], description="tables in double brackets, [[tree.view]], 99 at most"
    )
    position: Annotated[list[Metres], Len(3, 3)] = Field(default=[0.0, 0.0, 0.0], description=POSITION)
    heading: Degrees = Field(default=0.0, description=HEADING)
    method: str | None = Field(default=None, description=METHOD)
    seed: Seed | None = Field(default=None, description=SEED)
    settings: dict[str, dict[str, Any]] = Field(
        default={}, description="tables [tree.settings.STAGE] of that stage's fields"
    )
    stages: dict[str, str] = Field(default={}, description="a strategy's name in quotes for a stage's")
    gates: GateTable = Field(default=GateTable(), description="a table of thresholds")
    evergreen: bool = Field(default=False, description="true for a tree that keeps its leaves green all year, or false")


class CopyTable(Table):
    of: str = Field(description="the name of a [[tree]] in quotes")
    position: Annotated[list[Metres], Len(3, 3)] = Field(description=POSITION)
    heading: Degrees = Field(default=0.0, description=HEADING)
    scale: Factor = Field(default=1.0, description=FACTOR)


class SceneTable(Table):
    name: Name = Field(description=NAME)
    seed: Seed = Field(default=0, description=SEED)
    method: str = Field(default=DEFAULT_METHOD, description=METHOD)
    gates: GateTable = Field(default=GateTable(), description="a table of thresholds")


class Manifest(Table):
    """The whole of scene.toml."""

    scene: SceneTable = Field(description="a table [scene] with at least a name")
    tree: list[TreeTable] = Field(default=[], description="one table a tree, in double brackets: [[tree]]")
    copy_: list[CopyTable] = Field(
        default=[], alias="copy", description="one table a copy, in double brackets: [[copy]]"
    )
    scatter: list[Any] = Field(default=[], description="tables in double brackets: [[scatter]]")
