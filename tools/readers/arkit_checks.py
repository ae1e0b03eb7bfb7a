"""ARKit's rules as Pixar wrote them down: `python arkit_checks.py FILE...` in Blender's own Python.

OpenUSD had `usdchecker --arkit` (UsdUtils.ComplianceChecker) until 25; Blender 4.5 still brings it. Prints one line
of JSON: file -> what fails.
"""

import json
import sys

import bpy

bpy.utils.expose_bundled_modules()
from pxr import Usd, UsdUtils  # noqa: E402, TID251 - Blender's own


def main(files: list[str]) -> None:
    """Check each file."""
    found = {}
    for file in files:
        checker = UsdUtils.ComplianceChecker(arkit=True)
        checker.CheckCompliance(file)
        found[file] = [*checker.GetErrors(), *checker.GetFailedChecks(), *checker.GetWarnings()]
    print(json.dumps({"reader": f"OpenUSD {'.'.join(map(str, Usd.GetVersion()))}", "found": found}))


if __name__ == "__main__":
    main(sys.argv[1:])
