"""Fixtures: one tree as written by a build, with three levels of detail."""

from __future__ import annotations

from pathlib import Path

import pytest

from forestgen.reference import write_provenance
from forestgen.tree.extras import Extras
from forestgen.usd.tree_asset import write_tree_asset
from tests.export.subjects import CARD_RGBA, levels_of, oak


@pytest.fixture(scope="session")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a tree; not to be changed."""
    folder = tmp_path_factory.mktemp("trees") / "oak"
    model = oak()
    write_tree_asset(model, folder, Extras(levels_of(model)[1:], CARD_RGBA))
    write_provenance(model, folder / "reference")
    return folder
