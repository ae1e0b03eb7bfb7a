"""Arrays of the domain types: checked once, then read-only; and one random generator per stage."""

from __future__ import annotations

from typing import Any
from zlib import crc32

import numpy as np


def freeze(owner: Any, **specs: tuple[Any, ...]) -> None:
    """Coerce the named array fields of a frozen dataclass, check their shapes, make them read-only.

    A spec is `(dtype, *dims)`; a dim is a number, or a letter that must mean the same length in
    every field of the call. Arrays that already are as wanted are kept without a copy.

    Raises:
        ValueError: a shape does not fit, or a float field holds an infinity.
    """
    lengths: dict[str, tuple[int, str]] = {}
    for name, (dtype, *dims) in specs.items():
        array = np.asarray(getattr(owner, name), dtype=dtype)
        where = f"{type(owner).__name__}.{name}"
        if array.ndim != len(dims):
            raise ValueError(f"{where} has shape {array.shape}; expected ({', '.join(map(str, dims))})")
        for length, dim in zip(array.shape, dims, strict=True):
            if isinstance(dim, str):
                known, source = lengths.setdefault(dim, (length, where))
                if known != length:
                    raise ValueError(f"{where} has {dim} = {length}, but {source} has {dim} = {known}")
            elif length != dim:
                raise ValueError(f"{where} has shape {array.shape}; expected ({', '.join(map(str, dims))})")
        if array.dtype.kind == "f" and np.isinf(array).any():
            raise ValueError(f"{where} holds an infinite value")
        if array.flags.writeable:
            array = array.copy()  # the caller keeps his own, still writeable
            array.setflags(write=False)
        object.__setattr__(owner, name, array)


def stage_rng(seed: int, *key: str | int) -> np.random.Generator:
    """Give a stage its own generator, so that a change in one stage does not reshuffle the next."""
    words = [crc32(part.encode()) if isinstance(part, str) else part for part in key]
    return np.random.default_rng([seed, *words])
