"""Fixtures: one tree as written by a build, with three levels of detail."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.export.subjects import oak, write_tree


@pytest.fixture(scope="session")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a tree; not to be changed."""
    return write_tree(oak(), tmp_path_factory.mktemp("trees") / "oak")
