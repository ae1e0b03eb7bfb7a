"""The public front: what `import forestgen` gives, how light it is, and the lines that the docs show."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import forestgen


@pytest.mark.parametrize("name", forestgen.__all__)
def test_every_public_name_is_there(name):
    assert getattr(forestgen, name) is not None
    assert name in dir(forestgen)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = forestgen.nothing


def test_importing_forestgen_imports_nothing_else():
    code = "import sys, forestgen; print(*sorted({m.split('.')[0] for m in sys.modules} & {'numpy', 'typer', 'cv2'}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_a_tree_is_built_without_libraries_that_only_the_check_needs():
    code = (
        "import sys, forestgen.pipeline\n"
        "print(*sorted({m.split('.')[0] for m in sys.modules}"
        " & {'sklearn', 'pymatting', 'pyrender', 'jinja2', 'rich', 'typer', 'pxr', 'networkx', 'pytest'}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_the_command_and_the_module_are_one():
    done = subprocess.run([sys.executable, "-m", "forestgen", "--help"], capture_output=True, text=True, check=True)
    assert "forestgen" in done.stdout
    assert "build" in done.stdout


def test_the_package_carries_its_data():
    folder = Path(forestgen.__file__).parent
    assert (folder / "py.typed").is_file()
    for pattern in ("check/*.html", "render/shaders/*", "tree/grow/subtrees/*.json"):
        assert list(folder.glob(pattern)), pattern
