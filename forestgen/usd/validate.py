"""Validation of a written stage by every validator that comes with USD."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pxr import UsdValidation

from forestgen.usd.layers import open_stage


@dataclass(frozen=True)
class Finding:
    """What one validator found at one place."""

    validator: str
    error: str  # the validator's own name for it
    message: str
    place: str  # prim or property path, or the layer


def validate(path: Path) -> list[Finding]:
    """Open a stage with all payloads and ask all validators; no finding means an empty list.

    Raises:
        InputError: there is no such file, or it is no USD.
    """
    stage = open_stage(path)
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    return [_finding(error) for error in errors]


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
    name = validator.GetMetadata().name if validator else ""
    return Finding(str(name), str(error.GetName()), str(error.GetMessage()), ", ".join(places))
