"""Strategy: the base of every stage's algorithm. Its fields are the paper's parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar

from pydantic import ConfigDict

OnStep = Callable[[int, int, Mapping[str, float]], None]
"""Called by long loops with (done, total, named costs); total is 0 where it is not known."""


class Strategy:
    """A frozen dataclass with one `__call__`; settings from a manifest may replace any field.

    A field is a plain number, string or boolean with its source (paper and section) beside it.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")
