"""Checks of where things are: transforms that keep a volume, extents and hints that enclose what is drawn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pxr import UsdGeom

from forestgen.usd.finding import Finding, own_finding
from forestgen.usd.own_checks_values import Array, Values, at

NEAR = 1e-4  # share of a box's diagonal by which an authored extent may differ: float32 and another order of sums
PURPOSES = [UsdGeom.Tokens.default_, UsdGeom.Tokens.render, UsdGeom.Tokens.proxy, UsdGeom.Tokens.guide]


def transform(values: Values) -> Iterator[Finding]:
    """A prim's own transform neither flattens nor mirrors."""
    if not values.prim.HasAttribute("xformOpOrder"):
        return
    matrix = np.array(UsdGeom.Xformable(values.prim).GetLocalTransformation(values.time))[:3, :3]
    if not np.isfinite(matrix).all():
        return  # told by `finite`
    place = values.path.AppendProperty("xformOpOrder")
    volume = np.linalg.det(matrix)
    if volume < 0:
        yield own_finding("NegativeScale", place, f"the transform mirrors{at(values)}")
    elif abs(volume) <= 1e-12 * np.linalg.norm(matrix) ** 3 and not _varies(values):
        yield own_finding("ZeroScale", place, "the transform flattens what is below to nothing")


def _varies(values: Values) -> bool:
    return any(name.startswith("xformOp:") for name in values.samples)


def extent(values: Values) -> Iterator[Finding]:
    """The authored extent is what USD computes from points or instances."""
    box = values.array("extent", 3)
    if box is None or not _is_whole(values):
        return
    computed = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(values.prim), values.time)
    if computed is None or len(computed) != 2:
        return
    place = values.path.AppendProperty("extent")
    if len(box) != 2:
        yield own_finding("Extent", place, f"has {len(box)} corners, not 2{at(values)}")
    elif (off := _off(box, np.array(computed))) > 0:
        yield own_finding("Extent", place, f"is off by up to {off:.3g} units from what is drawn{at(values)}")


def _is_whole(values: Values) -> bool:
    """Whether USD can compute an extent: a prototype that is not there, which `instancer` tells, is an error to it."""
    if not values.prim.IsA(UsdGeom.PointInstancer):
        return True
    targets = UsdGeom.PointInstancer(values.prim).GetPrototypesRel().GetForwardedTargets()
    return all(values.prim.GetStage().GetPrimAtPath(target) for target in targets)


def _off(box: Array, computed: Array) -> float:
    """By how much two boxes (2, 3) differ, 0 within the tolerance; an empty box equals another empty one."""
    if not (np.isfinite(box).all() and np.isfinite(computed).all()):
        return 0.0  # told by `finite`
    if (computed[0] > computed[1]).any():
        return 0.0 if (box[0] > box[1]).any() or np.ptp(box, axis=0).max() == 0 else float(np.ptp(box, axis=0).max())
    diagonal = np.linalg.norm(np.ptp(computed.astype(float), axis=0))
    off = float(np.abs(box.astype(float) - computed).max())
    return off if off > NEAR * diagonal + 1e-6 * np.abs(computed).max() else 0.0


def extents_hint(values: Values, *, is_chosen: bool) -> Iterator[Finding]:
    """The extents hint encloses what is below the prim; in the variants that a file selects it is tight, too.

    In another variant (`is_chosen` false) there may be less to see, so it may be wider there.
    """
    hint = values.array("extentsHint", 3)
    if hint is None or not len(hint):
        return
    cache = UsdGeom.BBoxCache(values.time, PURPOSES, useExtentsHint=False)
    computed = np.array(UsdGeom.ModelAPI(values.prim).ComputeExtentsHint(cache)).reshape(-1, 2, 3)
    for k, box in enumerate(hint[: len(hint) // 2 * 2].reshape(-1, 2, 3)[: len(computed)]):
        truth = computed[k]
        if (truth[0] > truth[1]).any() or not (np.isfinite(box).all() and np.isfinite(truth).all()):
            continue
        outside = float(max((box[0] - truth[0]).max(), (truth[1] - box[1]).max(), 0))
        off = _off(box, truth)
        slack = NEAR * np.linalg.norm(np.ptp(truth.astype(float), axis=0)) + 1e-6 * np.abs(truth).max()
        place = values.path.AppendProperty("extentsHint")
        if outside > slack:
            message = f"what is drawn reaches {outside:.3g} units beyond the {PURPOSES[k]} box{at(values)}"
            yield own_finding("ExtentsHint", place, message)
        elif is_chosen and off > 0:
            message = f"the {PURPOSES[k]} box is up to {off:.3g} units wider than what is drawn{at(values)}"
            yield own_finding("ExtentsHint", place, message)
