"""Folders that a strategy's settings name: relative to the manifest in files, absolute while stages run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

from forestgen.scene.paths import Location
from forestgen.tree.methods import Method
from forestgen.tree.strategy import FOLDER


def located(method: Method, location: Location, where: str) -> Method:
    """The method with every folder that its settings name looked up. `where` begins the message: file and tree.

    Raises:
        InputError: a folder lies outside of the scene's root, or is not there.
    """
    for stage, key, text in _folders(method):
        found = location.directory(text, f"{where}: settings.{stage}.{key}")
        method = replace(method, **{stage: replace(getattr(method, stage), **{key: str(found)})})
    return method


def shown_settings(method: Method, location: Location) -> dict[str, dict[str, Any]]:
    """All settings by stage, as a manifest at the scene's root would give them."""
    settings = {stage.name: asdict(getattr(method, stage.name)) for stage in fields(method)}
    for stage, key, text in _folders(method):
        settings[stage][key] = location.shown(Path(text))
    return settings


def _folders(method: Method) -> Iterator[tuple[str, str, str]]:
    """Stage, field and text of every setting that names a folder."""
    for stage in fields(method):
        strategy = getattr(method, stage.name)
        for field in fields(strategy):
            if field.metadata.get(FOLDER) and getattr(strategy, field.name):
                yield stage.name, field.name, getattr(strategy, field.name)
