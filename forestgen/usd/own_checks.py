"""Our own checks of a stage: what no validator of USD looks at. One pass, each shared instance once."""

from __future__ import annotations

from collections.abc import Iterator

from pxr import Tf, Usd, UsdGeom

from forestgen.usd.finding import Finding, own_finding
from forestgen.usd.layers import reason
from forestgen.usd.own_checks_geometry import areas, curves, mesh, primvars, subset
from forestgen.usd.own_checks_instancer import instancer
from forestgen.usd.own_checks_links import assets, bindings, connections, layers
from forestgen.usd.own_checks_places import extent, extents_hint, transform
from forestgen.usd.own_checks_values import Values, finite, sample_lengths

LOADED = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)  # class and over too: prototypes may be such

Known = dict[tuple[object, ...], list[Finding]]  # what a prim's own arrays gave, by the opinions they come from


def own_findings(stage: Usd.Stage, known: Known) -> list[Finding]:
    """Ask all of our own checks about a stage.

    `known` remembers what was found in arrays: with the same dict, a stage whose variants changed
    is read only where it differs.
    """
    found = list(layers(stage))
    for prim, is_repeated in _prims(stage):
        try:
            values = Values(prim)
            found += _links(values)
            if not is_repeated and prim.HasAttribute("extentsHint"):
                for _ in values.times():
                    found += extents_hint(values)
            key = _key(prim)
            if key not in known:
                known[key] = list(_arrays(values))
            found += known[key]
        except Tf.ErrorException as error:
            found.append(own_finding("Unreadable", prim.GetPath(), reason(error)))
    return _without_consequences(found)


def _links(values: Values) -> Iterator[Finding]:
    yield from assets(values)
    yield from bindings(values)
    yield from connections(values)


def _without_consequences(found: list[Finding]) -> list[Finding]:
    """Leave out hints about boxes of which one below is wrong: what they should be is not known yet."""
    wrong = [each.place for each in found if each.error == "Extent"]
    return [
        each
        for each in found
        if each.error != "ExtentsHint" or not any(place.startswith(each.place.rpartition(".")[0]) for place in wrong)
    ]


def _prims(stage: Usd.Stage) -> Iterator[tuple[Usd.Prim, bool]]:
    """Every loaded prim, and whether it is an instance of what came before: then without what is below it."""
    seen = set()
    prims = iter(Usd.PrimRange(stage.GetPseudoRoot(), LOADED))
    next(prims)  # the pseudo-root itself
    for prim in prims:
        shared = prim.GetPrototype().GetPath() if prim.IsInstance() else None
        is_repeated = shared in seen
        if is_repeated:
            prims.PruneChildren()
        elif shared is not None:
            seen.add(shared)
        yield prim, is_repeated


def _key(prim: Usd.Prim) -> tuple[object, ...]:
    """The opinions on a prim's properties; of an instancer, its prototypes' too, on which its extent depends."""
    prims = [prim]
    if prim.IsA(UsdGeom.PointInstancer):
        targets = UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets()
        roots = [prim.GetStage().GetPrimAtPath(target) for target in targets]
        prims += [below for root in roots if root for below in Usd.PrimRange(root, LOADED)]
    opinions = (
        (spec.layer.identifier, spec.path)
        for each in prims
        for item in each.GetAuthoredProperties()
        for spec in item.GetPropertyStack()
    )
    return (prim.GetPath(), *opinions)


def _arrays(values: Values) -> Iterator[Finding]:
    """What the arrays and transforms of one prim show, at every time; of each fault the first time."""
    told: dict[tuple[str, str], Finding] = {}
    for k, _ in enumerate(values.times()):
        for finding in _at_time(values, k == 0):
            told.setdefault((finding.error, finding.place), finding)
    yield from told.values()
    places = {finding.place for finding in told.values()}
    yield from (finding for finding in sample_lengths(values) if finding.place not in places)


def _at_time(values: Values, is_first: bool) -> Iterator[Finding]:
    prim = values.prim
    yield from finite(values, is_first)
    if prim.IsA(UsdGeom.Xformable):
        yield from transform(values)
    if prim.IsA(UsdGeom.Subset):
        yield from subset(values)
    if prim.IsA(UsdGeom.Mesh):
        yield from mesh(values)
        if is_first:
            yield from areas(values)
    elif prim.IsA(UsdGeom.Curves):
        yield from curves(values)
    elif prim.IsA(UsdGeom.PointInstancer):
        yield from instancer(values)
    if prim.IsA(UsdGeom.Boundable):
        yield from primvars(values)
        yield from extent(values)
