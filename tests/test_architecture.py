"""Who may import whom, and what no file may use: the house's walls, checked from the source."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "forestgen"
FILES = sorted(PACKAGE.rglob("*.py"))

# A layer may import itself and those before it.
LAYERS = [
    "errors",
    "arrays",
    "reading",
    "png",
    "interrupts",
    "blas",
    "staging",
    "camera",
    "tree",
    "scene",
    "reference",
    "render",
    "usd",
    "check",
    "export",
    "workers",
    "progress",
    "summary",
    "doctor",
    "build_record",
    "dressing",
    "finishing",
    "pipeline",
    "exporting",
    "growing",
    "variation",
    "complaints",
    "cli",
]

# Inside tree/: what each stage may never import (its neighbours), so that strategies stay independent.
STAGE_FOLDERS = ["segment", "trace", "lift", "grow"]

ONLY_IN = {
    "pxr": "usd/",
    "pyrender": "render",
    "maxflow": "tree/segment/min_cut.py",
    "typer": "cli.py",
}
CLOCKS = {"time", "datetime", "uuid", "random", "secrets"}
MAY_TIME = {"tree/build.py", "pipeline.py"}


def imports(path: Path) -> list[tuple[str, list[str]]]:
    """(module, names) of every import in a file, also those inside functions."""
    found: list[tuple[str, list[str]]] = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found += [(alias.name, []) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found.append((node.module or "", [alias.name for alias in node.names]))
    return found


def layer_of(dotted: str) -> str:
    return dotted.split(".")[1] if "." in dotted else ""


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_down_only(path: Path) -> None:
    here = path.relative_to(PACKAGE)
    own = here.parts[0].removesuffix(".py")
    if own in {"__init__", "__main__"}:
        pytest.skip("the public front may import anything")
    for module, _ in imports(path):
        if module.startswith("forestgen."):
            assert LAYERS.index(layer_of(module)) <= LAYERS.index(own), f"{here} imports {module}"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_each_foreign_library_has_one_home(path: Path) -> None:
    here = str(path.relative_to(PACKAGE))
    for module, _ in imports(path):
        home = ONLY_IN.get(module.split(".")[0])
        assert home is None or here.startswith(home), f"{here} imports {module}; only {home} may"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_no_clock_and_no_global_randomness(path: Path) -> None:
    here = str(path.relative_to(PACKAGE))
    for module, _ in imports(path):
        assert module.split(".")[0] not in CLOCKS or here in MAY_TIME, f"{here} imports {module}"
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Attribute) and node.attr in {"default_rng", "RandomState", "setRNGSeed"}:
            assert here == "arrays.py", f"{here}: take a generator as rng"


@pytest.mark.parametrize("stage", STAGE_FOLDERS)
def test_stages_do_not_know_each_other(stage: str) -> None:
    for path in sorted((PACKAGE / "tree" / stage).rglob("*.py")):
        for module, _ in imports(path):
            others = [f"forestgen.tree.{other}." for other in STAGE_FOLDERS if other != stage]
            assert not any((module + ".").startswith(other) for other in others), f"{path} imports {module}"
            assert module != "forestgen.tree.methods"


def test_only_methods_names_the_papers() -> None:
    for path in sorted((PACKAGE / "tree").rglob("*.py")):
        source = ast.parse(path.read_text())
        for node in ast.walk(source):
            if isinstance(node, ast.Compare):
                literals = [c.value for c in node.comparators if isinstance(c, ast.Constant)]
                assert not {"tan2008", "neubert2007", "kim2014"} & set(map(str, literals)), path
