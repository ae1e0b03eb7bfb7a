"""lightusd composes every file of every profile, and agrees with USD on counts, bounds and sums."""

from __future__ import annotations

import pytest
from numpy.testing import assert_allclose
from pxr import Usd

from forestgen.usd.profiles import PROFILES
from tests.readers.conftest import ROOT_PRIMS, Made
from tests.readers.strangers import ask, assert_agree, composed, places
from tests.usd.subjects import SUBJECTS


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("subject", SUBJECTS)
def test_it_reads_what_usd_reads(made: Made, subject: str, profile: str) -> None:
    path = made[subject, profile]
    answer = ask("lightusd", "lightusd_reads.py", path)
    assert (answer["up"], answer["metres"], answer["default"]) == ("Y", 1.0, ROOT_PRIMS[subject])
    stage = Usd.Stage.Open(str(path))
    ours = composed(stage)
    assert len(ours) >= 1
    assert_agree(answer["prims"], ours)
    for prim, place in places(stage).items():
        assert_allclose(answer["places"][prim], place, atol=1e-6, err_msg=prim)


@pytest.mark.parametrize("profile", ["usd", "unreal"])
@pytest.mark.parametrize("level", ["LOD0", "LOD1", "LOD2"])
def test_it_selects_each_level(made: Made, profile: str, level: str) -> None:
    path = made["oak", profile]
    answer = ask("lightusd", "lightusd_reads.py", path, f"LOD={level}")
    stage = Usd.Stage.Open(str(path))
    stage.SetEditTarget(stage.GetSessionLayer())
    stage.GetDefaultPrim().GetVariantSet("LOD").SetVariantSelection(level)
    ours = composed(stage)
    assert all(level in prim for prim in ours)
    assert_agree(answer["prims"], ours)
