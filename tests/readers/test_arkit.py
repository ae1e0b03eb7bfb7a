"""Packages for AR keep ARKit's rules, as OpenUSD's own checker of them (up to 25) has it."""

from __future__ import annotations

from forestgen.usd.profiles import FLAT
from tests.readers.conftest import Made
from tests.readers.strangers import ask
from tests.usd.subjects import SUBJECTS


def test_no_rule_of_arkit_is_broken(made: Made) -> None:
    files = [made[subject, profile] for subject in SUBJECTS for profile in FLAT]
    found = ask("bpy", "arkit_checks.py", *files)["found"]
    assert found == {str(file): [] for file in files}


def test_the_checker_sees_what_arkit_refuses(made: Made) -> None:
    (told,) = ask("bpy", "arkit_checks.py", made["oak", "usd"])["found"].values()
    assert any("unsupported type 'PointInstancer'" in failure for failure in told)
