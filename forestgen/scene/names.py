"""Prim, folder and file names: a name of any kind made an ASCII identifier."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

MAX_LENGTH = 64

# Folders that Windows cannot make, in lower case.
RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{digit}" for port in ("com", "lpt") for digit in range(1, 10))}


def prim_names(names: Sequence[str], fallback: str = "tree") -> list[str]:
    """For each name an ASCII identifier of at most 64 characters, `_2` (`_3`, ...) appended on collision.

    Names that differ only in case count as colliding: they share one folder on some file systems.
    A name of which nothing is left becomes `fallback`.

    >>> prim_names(["Oak (old)", "oak old", "Älterer Baum", "3rd", "🌳", "plane_01"])
    ['Oak_old', 'oak_old_2', 'Alterer_Baum', '_3rd', 'tree', 'plane_01']
    """
    taken = set(RESERVED)
    last_count: dict[str, int] = {}  # ten thousand trees of one name are numbered in one go
    found = []
    for name in names:
        base = identifier(name) or fallback
        unique, count = base, last_count.get(base, 1)
        while unique.lower() in taken:
            count += 1
            unique = f"{base[: MAX_LENGTH - len(str(count)) - 1]}_{count}"
        last_count[base] = count
        taken.add(unique.lower())
        found.append(unique)
    return found


def identifier(name: str) -> str:
    """A name as an ASCII identifier; empty where nothing of it is left.

    Accents are dropped, runs of other characters become one underscore, none at the ends.
    """
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    spaced = re.sub(r"[^0-9A-Za-z_]+", " ", plain).strip()
    joined = spaced.replace(" ", "_")
    return ("_" + joined if joined[:1].isdigit() else joined)[:MAX_LENGTH]
