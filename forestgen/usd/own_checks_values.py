"""A prim's attributes as arrays, at one time after another; and whether their values are numbers at all."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from forestgen.usd.finding import Finding, own_finding

NUMBERS = ("points", "normals", "widths", "positions", "scales", "orientations", "orientationsf", "extent")
RATES = ("velocities", "accelerations", "angularVelocities")
SCALARS = ("inputs:", "xformOp:", "primvars:")  # attributes of these names are to be finite too
FLOATS = ("half", "float", "double", "vector", "point", "normal", "color", "quat", "matrix", "texCoord", "frame")
MIGHT_CHANGE_SHAPE = (
    "faceVertexCounts", "faceVertexIndices", "tetVertexIndices", "curveVertexCounts", "protoIndices", "ids",
)  # fmt: skip

Array = NDArray  # type: ignore[type-arg]  # of whatever numbers the attribute holds


class Values:
    """The attributes of one prim at the time `time`; what does not vary is read once."""

    def __init__(self, prim: Usd.Prim) -> None:
        self.prim = prim
        self.path = prim.GetPath()
        self.time = Usd.TimeCode.Default()
        self.kept: dict[str, Array | None] = {}
        attributes = prim.GetAuthoredAttributes()
        self.samples = {a.GetName(): a.GetTimeSamples() for a in attributes if a.GetNumTimeSamples()}

    def times(self) -> Iterator[Usd.TimeCode]:
        """Step through all times at which an attribute has a sample; the default time alone where none has any."""
        every = sorted({time for times in self.samples.values() for time in times})
        for self.time in [Usd.TimeCode(time) for time in every] or [Usd.TimeCode.Default()]:
            yield self.time

    def varies(self, *names: str) -> bool:
        """Whether one of the attributes has time samples."""
        return any(name in self.samples for name in names)

    def is_between(self, name: str) -> bool:
        """Whether an attribute's value at the time is blended from its samples, none of which is there."""
        return name in self.samples and self.time.GetValue() not in self.samples[name]

    def array(self, name: str, width: int = 0) -> Array | None:
        """The values (N,), or (N, width), at the time; None where there are none, or no array of numbers."""
        if name not in self.kept:
            attribute = self.prim.GetAttribute(name)
            value = attribute.Get(self.time) if attribute else None
            array = None if value is None else np.asarray(value)
            if array is not None and (array.dtype.kind not in "iufb" or not attribute.GetTypeName().isArray):
                array = None
            if name in self.samples:
                return _shaped(array, width)
            self.kept[name] = array
        return _shaped(self.kept[name], width)

    def count(self, name: str, width: int = 0) -> int:
        """How many values an array has at the time; 0 where there is none."""
        array = self.array(name, width)
        return 0 if array is None else len(array)


def _shaped(array: Array | None, width: int) -> Array | None:
    return array if array is None or not width else array.reshape(-1, width)


def finite(values: Values, is_first: bool) -> Iterator[Finding]:
    """Points, normals, transforms, widths, primvars, shader inputs: every number is a number."""
    for attribute in values.prim.GetAuthoredAttributes():
        name, kind = attribute.GetName(), str(attribute.GetTypeName())
        is_number = name in NUMBERS or name in RATES or name.startswith(SCALARS)
        if not (is_number and kind.startswith(FLOATS)) or not (is_first or name in values.samples):
            continue
        value = values.array(name) if attribute.GetTypeName().isArray else attribute.Get(values.time)
        if value is None:
            continue
        array = _numbers(value)
        bad = ~np.isfinite(array)
        if bad.any():
            is_array = kind.endswith("[]")
            n = int(bad.reshape(len(array), -1).any(axis=1).sum()) if is_array else 1
            what = f"{n} of {len(array)} values are" if is_array else "the value is"
            yield own_finding("NotFinite", attribute.GetPath(), f"{what} NaN or infinite{at(values)}")


def _numbers(value: Any) -> Array:
    """Any of USD's values as an array; a quaternion, which numpy cannot read, by its parts."""
    if hasattr(value, "GetImaginary"):
        return np.array([value.GetReal(), *value.GetImaginary()])
    return np.asarray(value)


def sample_lengths(values: Values) -> Iterator[Finding]:
    """The time samples of an array are equally long, unless the topology is sampled too; particles may come and go."""
    if values.varies(*MIGHT_CHANGE_SHAPE) or values.prim.IsA(UsdGeom.Points):
        return
    for attribute in values.prim.GetAuthoredAttributes():
        name = attribute.GetName()
        is_meant = name.startswith((*NUMBERS, *RATES, "primvars:")) and attribute.GetTypeName().isArray
        if not is_meant or name not in values.samples:
            continue
        lengths = sorted({len(attribute.Get(time) or []) for time in values.samples[name]})
        if len(lengths) > 1:
            message = f"its time samples have {lengths[0]} to {lengths[-1]} values, the topology has no samples"
            yield own_finding("SampleLengths", attribute.GetPath(), message)


def at(values: Values) -> str:
    """` at time 12`, for messages; nothing at the default time."""
    return "" if values.time.IsDefault() else f" at time {values.time.GetValue():g}"
