"""Fixtures: where the sample scenes lie, and where the shared photographs may lie."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def scenes() -> Path:
    """The folder of the sample scenes in this repository."""
    return ROOT / "scenes"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of photographs, ground truth and the independent scorer, beside the checkout."""
    folder = ROOT.parent / "shared"
    if not (folder / "ground_truth").is_dir():
        pytest.skip("the folder 'shared' with photographs and ground truth is not beside this checkout")
    return folder
