"""Checks of where things are: transforms that keep a volume, extents and hints that enclose what is drawn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pxr import UsdGeom

from forestgen.usd.finding import Finding, own_finding
from forestgen.usd.own_checks_values import Array, Values, at

NEAR = 1e-4  # share of a box's diagonal by which an authored extent may differ: float32 and another order of sums
ROUGH = 0.02  # share of it by which a hint may be wider, and variants may reach beyond a hint that serves all
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
    """Whether USD can say what the extent is: of shapes, and of instancers of which all prototypes are there.

    The extent of a skeleton's root is its author's estimate of all poses.
    """
    if not values.prim.IsA(UsdGeom.PointInstancer):
        return bool(values.prim.IsA(UsdGeom.Gprim))
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


def extents_hint(values: Values) -> Iterator[Finding]:
    """The extents hint encloses what is below the prim and is not much wider.

    Where a prim has variants, one hint serves them all: a variant may reach a little beyond, as
    coarser levels of detail do, and may show less, up to half.
    """
    hint = values.array("extentsHint", 3)
    if hint is None or not len(hint):
        return
    cache = UsdGeom.BBoxCache(values.time, PURPOSES, useExtentsHint=False)
    computed = np.array(UsdGeom.ModelAPI(values.prim).ComputeExtentsHint(cache)).reshape(-1, 2, 3)
    place, is_varied = values.path.AppendProperty("extentsHint"), values.prim.HasVariantSets()
    for purpose, box, truth in zip(PURPOSES, hint[: len(hint) // 2 * 2].reshape(-1, 2, 3), computed, strict=False):
        if (truth[0] > truth[1]).any() or not (np.isfinite(box).all() and np.isfinite(truth).all()):
            continue
        diagonal = np.linalg.norm(np.ptp(truth.astype(float), axis=0))
        near = NEAR * diagonal + 1e-6 * np.abs(truth).max()
        outside = float(max((box[0] - truth[0]).max(), (truth[1] - box[1]).max()))
        wider = float(max((truth[0] - box[0]).max(), (box[1] - truth[1]).max()))
        if outside > (ROUGH * diagonal if is_varied else near):
            message = f"what is drawn reaches {outside:.3g} units beyond the {purpose} box{at(values)}"
            yield own_finding("ExtentsHint", place, message)
        elif wider > (diagonal if is_varied else ROUGH * diagonal):
            message = f"the {purpose} box is up to {wider:.3g} units wider than what is drawn{at(values)}"
            yield own_finding("ExtentsHint", place, message)
