"""What this machine lacks: the libraries that forestgen needs, and an OpenGL to render with."""

from __future__ import annotations

import platform
import re
from dataclasses import dataclass
from importlib import metadata

from forestgen.errors import RenderError


@dataclass(frozen=True)
class Finding:
    """One thing looked at: what it is, whether it will do, and what to do where it will not."""

    what: str
    is_good: bool
    remedy: str = ""


def examine() -> list[Finding]:
    """Look at the interpreter, the packages and the renderer, in that order."""
    findings = [Finding(f"Python {platform.python_version()} on {platform.system()} {platform.machine()}", True)]
    findings += [_package(name) for name in required_packages()]
    if all(finding.is_good for finding in findings):
        findings.append(_renderer())
    else:
        findings.append(Finding("OpenGL offscreen: not tried, packages are missing", False, "run: make setup"))
    return findings


def required_packages() -> list[str]:
    """Names of the packages that forestgen says it needs, without those for tests; none where it is not installed."""
    try:
        requirements = metadata.requires("forestgen") or []
    except metadata.PackageNotFoundError:
        return ["forestgen"]  # whose absence is then the finding
    return [re.split(r"[^A-Za-z0-9_.-]", line)[0] for line in requirements if "extra ==" not in line]


def _package(name: str) -> Finding:
    try:
        return Finding(f"{name} {metadata.version(name)}", True)
    except metadata.PackageNotFoundError:
        return Finding(f"{name} is not installed", False, "run: make setup")


def _renderer() -> Finding:
    from forestgen.render import gl_description

    try:
        return Finding(f"OpenGL offscreen: {gl_description()}", True)
    except RenderError as error:
        return Finding("OpenGL offscreen", False, str(error))
