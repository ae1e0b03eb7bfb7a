"""Fixtures: every profile of a leafy and a bare tree and of their scene, for readers to read.

The scene comes twice: trees as prims (`wood`), and as points of an instancer (`points`).
"""

from __future__ import annotations

from pathlib import Path

import pytest

from forestgen.usd.profiles import PROFILES, write_profile
from tests.usd.subjects import SUBJECTS, write_subjects

ROOT_PRIMS = {"oak": "oak", "bare": "bare", "wood": "wood", "points": "wood"}  # the default prims' names
Made = dict[tuple[str, str], Path]


@pytest.fixture(scope="session")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene of two trees, written; not to be changed."""
    return write_subjects(tmp_path_factory.mktemp("readers ü"))


@pytest.fixture(scope="session")
def made(out: Path) -> Made:
    """The file of each profile, by (subject, profile); not to be changed."""
    home = out.parent / "profiles"
    return {
        (subject, profile): write_profile(out.parent / where, home / subject / profile, profile)
        for subject, where in SUBJECTS.items()
        for profile in PROFILES
    }
