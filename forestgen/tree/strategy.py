"""Strategy: the base of every stage's algorithm. Its fields are the paper's parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any, ClassVar

from pydantic import ConfigDict

OnStep = Callable[[int, int, Mapping[str, float]], None]
"""Called by long loops with (done, total, named costs); total is 0 where it is not known."""

FOLDER = "folder"  # in a field's metadata: the setting names a folder


def folder_setting() -> Any:
    """A field of a strategy that names a folder, "" for none; a manifest gives it relative to itself."""
    return field(default="", metadata={FOLDER: True})


class Strategy:
    """A frozen dataclass with one `__call__`; settings from a manifest may replace any field.

    A field is a plain number, string or boolean with its source (paper and section) beside it.
    """

    most_views: ClassVar[int | None] = None  # photos of one tree that it takes; None = any number
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")
