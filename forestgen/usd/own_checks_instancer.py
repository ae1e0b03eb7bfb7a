"""Checks of point instancers: prototypes, lengths, quaternions, scales, hidden ids."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pxr import UsdGeom

from forestgen.usd.finding import Finding, own_finding
from forestgen.usd.own_checks_geometry import in_range
from forestgen.usd.own_checks_values import Values, at

# how far a stored quaternion's length may be from 1: rounding moves each part by half a unit in its last place
UNIT = {"orientations": 2e-3, "orientationsf": 1e-4}  # halfs have 11 bits: 2 ** -11 a part; text has five digits
PER_INSTANCE = {
    "positions": 3, "orientations": 4, "orientationsf": 4, "scales": 3, "velocities": 3, "accelerations": 3,
    "angularVelocities": 3, "ids": 0,
}  # fmt: skip


def instancer(values: Values) -> Iterator[Finding]:
    """Every instance has a prototype that exists, a place, and whatever else is authored."""
    targets = UsdGeom.PointInstancer(values.prim).GetPrototypesRel().GetForwardedTargets()
    which = values.array("protoIndices")
    n = values.count("protoIndices")
    rel = values.path.AppendProperty("prototypes")
    missing = [target for target in targets if not values.prim.GetStage().GetPrimAtPath(target)]
    if n and not targets:
        yield own_finding("NoPrototype", rel, f"{n} instances, but no prototype is named")
    for target in missing:
        yield own_finding("NoPrototype", rel, f"there is no prim {target}")
    if targets:
        yield from in_range(values, "protoIndices", which, len(targets), "prototypes", "ProtoIndexRange")
    for name, width in PER_INSTANCE.items():
        array = values.array(name, width)
        is_needed = name == "positions"
        if (array is None or not len(array)) and not (is_needed and n):
            continue  # nothing authored: the schema has a default
        if (length := values.count(name, width)) != n:
            place = values.path.AppendProperty(name)
            yield own_finding("InstanceLengths", place, f"has {length} values for {n} protoIndices{at(values)}")
    yield from _quaternions(values)
    yield from _scales(values)
    yield from _hidden(values, n)


def _quaternions(values: Values) -> Iterator[Finding]:
    for name, tolerance in UNIT.items():
        turn = values.array(name, 4)
        if turn is None or not len(turn) or values.is_between(name):
            continue
        part = turn.astype(np.float32)
        off = np.abs(np.sqrt(np.einsum("lq,lq->l", part, part)) - 1)
        if n := int((off > tolerance).sum()):  # NaN is told by `finite`
            worst = float(np.nanmax(off))
            message = f"{n} of {len(turn)} quaternions are not unit, off by up to {worst:.2g}{at(values)}"
            yield own_finding("NotUnitQuaternion", values.path.AppendProperty(name), message)


def _scales(values: Values) -> Iterator[Finding]:
    scale = values.array("scales", 3)
    if scale is None:
        return
    place = values.path.AppendProperty("scales")
    if not values.varies("scales") and (n := int((scale == 0).any(axis=1).sum())):  # what grows starts at nothing
        yield own_finding("ZeroScale", place, f"{n} of {len(scale)} instances have a scale of 0")
    if n := int((scale < 0).any(axis=1).sum()):
        yield own_finding("NegativeScale", place, f"{n} of {len(scale)} instances have a negative scale{at(values)}")


def _hidden(values: Values, n: int) -> Iterator[Finding]:
    hidden = values.array("invisibleIds")
    if hidden is None or not len(hidden):
        return
    ids = values.array("ids")
    if ids is None or not len(ids):
        ids = np.arange(n)
    unknown = hidden[~np.isin(hidden, ids)]
    if len(unknown):
        place = values.path.AppendProperty("invisibleIds")
        message = f"{len(unknown)} of {len(hidden)} are no id of the {n} instances, such as {unknown[0]}{at(values)}"
        yield own_finding("InvisibleIds", place, message)
