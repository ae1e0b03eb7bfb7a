"""What this machine lacks: each library that forestgen needs, and an OpenGL to render with."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from importlib import metadata

from forestgen.errors import RenderError

PACKAGES = (
    "numpy",
    "scipy",
    "scikit-image",
    "opencv-contrib-python-headless",
    "PyMaxflow",
    "trimesh",
    "xatlas",
    "usd-core",
    "pyrender",
    "numba",
)


@dataclass(frozen=True)
class Finding:
    """One thing looked at: what it is, whether it will do, and what to do where it will not."""

    what: str
    is_good: bool
    remedy: str = ""


def examine() -> list[Finding]:
    """Look at the interpreter, the packages and the renderer, in that order."""
    findings = [Finding(f"Python {platform.python_version()} on {platform.system()} {platform.machine()}", True)]
    for package in PACKAGES:
        try:
            findings.append(Finding(f"{package} {metadata.version(package)}", True))
        except metadata.PackageNotFoundError:
            findings.append(Finding(f"{package} is missing", False, "run: make setup"))
    findings.append(_renderer())
    return findings


def _renderer() -> Finding:
    from forestgen.render import gl_description

    try:
        return Finding(f"OpenGL offscreen: {gl_description()}", True)
    except RenderError as error:
        return Finding("OpenGL offscreen", False, str(error))
