"""Checks of where things are: transforms that keep a volume, extents and hints that enclose what is drawn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pxr import UsdGeom

from forestgen.usd.finding import Finding, own_finding
from forestgen.usd.own_checks_values import Array, Values, at

NEAR = 1e-4  # share of the diagonal by which a box may always differ: float32 and another order of sums
ROUGH = 0.02  # share by which a box may be wider, and variants may reach beyond a hint that serves them all
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
    """The authored extent encloses what USD computes from points or instances, and is not much wider."""
    box = values.array("extent", 3)
    if box is None or not _is_whole(values):
        return
    computed = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(values.prim), values.time)
    if computed is None or len(computed) != 2:
        return
    place = values.path.AppendProperty("extent")
    if len(box) != 2:
        yield own_finding("Extent", place, f"has {len(box)} corners, not 2{at(values)}")
    elif message := _unlike(box, np.array(computed), beyond=0.0, wider=ROUGH):
        yield own_finding("Extent", place, message + at(values))


def _is_whole(values: Values) -> bool:
    """Whether USD can say what the extent is: of shapes, and of instancers of which all prototypes are there.

    The extent of a skeleton's root is its author's estimate of all poses.
    """
    if not values.prim.IsA(UsdGeom.PointInstancer):
        return bool(values.prim.IsA(UsdGeom.Gprim))
    targets = UsdGeom.PointInstancer(values.prim).GetPrototypesRel().GetForwardedTargets()
    return all(values.prim.GetStage().GetPrimAtPath(target) for target in targets)


def _unlike(box: Array, truth: Array, beyond: float, wider: float) -> str:
    """How a box (2, 3) differs from what is drawn; nothing where it does not.

    `beyond` and `wider`: by which share of the diagonal it may be too small and too large.
    """
    box, truth = box.astype(float), truth.astype(float)
    if (truth[0] > truth[1]).any() or not (np.isfinite(box).all() and np.isfinite(truth).all()):
        return ""  # nothing is drawn, or it is told by `finite`
    diagonal = np.linalg.norm(np.ptp(truth, axis=0))
    near = NEAR * diagonal + 1e-6 * np.abs(truth).max()
    if (outside := max((box[0] - truth[0]).max(), (truth[1] - box[1]).max())) > max(near, beyond * diagonal):
        return f"what is drawn reaches {outside:.3g} units beyond the box"
    if (slack := max((truth[0] - box[0]).max(), (box[1] - truth[1]).max())) > max(near, wider * diagonal):
        return f"the box is up to {slack:.3g} units wider than what is drawn"
    return ""


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
    beyond, wider = (ROUGH, 1.0) if values.prim.HasVariantSets() else (0.0, ROUGH)
    for purpose, box, truth in zip(PURPOSES, hint[: len(hint) // 2 * 2].reshape(-1, 2, 3), computed, strict=False):
        if message := _unlike(box, truth, beyond, wider):
            place = values.path.AppendProperty("extentsHint")
            yield own_finding("ExtentsHint", place, f"purpose {purpose}: {message}{at(values)}")
