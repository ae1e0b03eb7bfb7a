"""Validation of a file as it is on disk: every validator that comes with USD, and our own checks."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from pxr import Tf, Usd, UsdUtils, UsdValidation

from forestgen.errors import InputError
from forestgen.usd.finding import ANY_REMEDY, USD_REMEDIES, Finding, own_finding
from forestgen.usd.layers import open_stage, reason
from forestgen.usd.mtlx_nodes import register_nodes
from forestgen.usd.own_checks import Known, own_findings
from forestgen.usd.own_checks_links import GONE

SEVERITIES = {"Error": "error", "Warn": "warning", "Info": "info"}


def validate_file(path: Path) -> list[Finding]:
    """Everything found in a file: in the variants that it selects, then in each other variant of the default prim.

    A variant is looked at with all other sets as the file selects them, not in every combination.
    What is found there as well as in the file's own selection is told once. Nothing is changed.

    Raises:
        InputError: there is no such file, or it cannot be opened as USD.
    """
    with _quiet():
        stage = _open(path)
        known: Known = {}
        found = _findings(stage, known)
        told = {(each.validator, each.error, each.place) for each in found}
        for variant in _other_variants(stage):
            for each in _findings(stage, known):
                if (each.validator, each.error, each.place) not in told:
                    found.append(replace(each, place=_in_variant(each.place, *variant)))
        return _sorted(found, path)


def validate(path: Path) -> list[Finding]:
    """Everything found in a file as it opens, in the variants that it selects.

    Raises:
        InputError: there is no such file, or it cannot be opened as USD.
    """
    with _quiet():
        return _sorted(_findings(_open(path), {}), path)


def usd_findings(stage: Usd.Stage) -> list[Finding]:
    """What USD's own validators find in an open stage; in shared instances, in the first of them."""
    register_nodes()
    found: dict[tuple[str, ...], Finding] = {}
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    try:
        errors = UsdValidation.ValidationContext(validators).Validate(stage)
    except Tf.ErrorException as damage:  # one of them stumbled over a damaged layer: all others, each alone
        found[("",)] = own_finding("Unreadable", stage.GetRootLayer().GetDisplayName(), reason(damage))
        errors = [error for validator in validators for error in _alone(validator, stage)]
    for error in errors:
        each = _finding(error)
        shared = _shared(error)
        key = (each.validator, each.error, shared or each.place, "" if shared else each.message)
        found.setdefault(key, each)
    return list(found.values())


def _alone(validator: UsdValidation.Validator, stage: Usd.Stage) -> list[UsdValidation.ValidationError]:
    try:
        return list(UsdValidation.ValidationContext([validator]).Validate(stage))
    except Tf.ErrorException:
        return []  # told once, as damage


@contextmanager
def _quiet() -> Iterator[None]:
    """What USD would write on the terminal while it opens a broken stage is dropped: it comes as findings."""
    silencer = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        silencer.TakeUncoalescedDiagnostics()
        del silencer


def _open(path: Path) -> Usd.Stage:
    """The stage of a file.

    Raises:
        InputError: one line.
    """
    if path.is_dir():
        raise InputError(f"{path}: is a folder; expected a USD file: name the .usda, .usdc, .usd or .usdz in it")
    if path.is_file() and not path.stat().st_size:
        raise InputError(f"{path}: is empty; expected a USD file: write or copy it again")
    try:
        return open_stage(path)
    except InputError as error:
        raise InputError(" ".join(str(error).split())) from error


def _findings(stage: Usd.Stage, known: Known) -> list[Finding]:
    return own_findings(stage, known) + usd_findings(stage)


def _other_variants(stage: Usd.Stage) -> Iterator[tuple[str, str, str]]:
    """Select each variant of the default prim that the file does not, for as long as it is looked at.

    Gives (prim path, set, variant). The selection is made in the session layer, which no file holds.
    """
    prim = stage.GetDefaultPrim()
    if not prim:
        return
    sets = prim.GetVariantSets()
    for name in sets.GetNames():
        chosen = sets.GetVariantSelection(name)
        for variant in prim.GetVariantSet(name).GetVariantNames():
            if variant == chosen:
                continue
            with Usd.EditContext(stage, stage.GetSessionLayer()):
                prim.GetVariantSet(name).SetVariantSelection(variant)
            yield str(prim.GetPath()), name, variant
            with Usd.EditContext(stage, stage.GetSessionLayer()):
                prim.GetVariantSet(name).ClearVariantSelection()


def _in_variant(place: str, prim: str, name: str, variant: str) -> str:
    """A place with the variant in which it was found, in USD's own notation: /oak{LOD=LOD2}geo/leaves."""
    mark = f"{{{name}={variant}}}"
    below = place.removeprefix(prim)
    if not place.startswith(prim) or below[:1] not in ("", "/", "."):
        return f"{place} {mark}"
    return f"{prim}{mark}{below.removeprefix('/')}"


def _finding(error: UsdValidation.ValidationError) -> Finding:
    places = []
    for site in error.GetSites():
        if site.IsProperty():
            places.append(str(site.GetProperty().GetPath()))
        elif site.IsPrim():
            places.append(str(site.GetPrim().GetPath()))
        elif site.GetLayer():
            places.append(site.GetLayer().GetDisplayName())
    validator = error.GetValidator()
    name = str(validator.GetMetadata().name) if validator else ""
    remedy = USD_REMEDIES.get(str(error.GetName())) or USD_REMEDIES.get(name.rpartition(":")[2], ANY_REMEDY)
    severity = SEVERITIES.get(error.GetType().displayName, "error")
    return Finding(name, str(error.GetName()), str(error.GetMessage()), ", ".join(places), severity, remedy)


def _shared(error: UsdValidation.ValidationError) -> str:
    """Where a finding lies in the content that instances share; nothing where it lies in no instance."""
    for site in error.GetSites():
        prim = site.GetPrim() if site.IsPrim() or site.IsProperty() else None
        if prim and prim.IsInstanceProxy():
            name = site.GetProperty().GetName() if site.IsProperty() else ""
            return f"{prim.GetPrimInPrototype().GetPath()}.{name}"
    return ""


def _sorted(found: list[Finding], path: Path) -> list[Finding]:
    """Each fault once, by place, validator and text; files below the checked one's folder by their relative paths."""
    home = f"{path.absolute().parent.as_posix()}/"
    each_once = {each for each in found if not any(_says_the_same(each, other) for other in found)}
    short = (replace(each, message=each.message.replace(home, "./")) for each in each_once)
    return sorted(short, key=lambda each: (each.place, each.validator, each.error, each.message))


def _says_the_same(finding: Finding, other: Finding) -> bool:
    """Whether what a validator of USD finds is what another check says of the very prim."""
    if finding.error == "UnresolvableDependency" and other.error in ("AssetMissing", "CompositionError"):
        lost = finding.message.rpartition("'")[0]
        named = re.findall("@(.+?)@", other.message) or [other.message.removesuffix(GONE)]
        return any(lost.endswith(re.sub(r"^(\.\.?/)+", "", name)) for name in named)
    return (finding.error, other.error, finding.place) == ("InvalidResourcePath", "BindingTarget", other.place)
