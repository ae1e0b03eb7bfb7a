"""Same tree, same bytes; and a write that fails is never taken for one that succeeded."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from pxr import Usd

from forestgen.usd.layers import relative, require_prim_name
from forestgen.usd.tree_asset import write_tree_asset
from tests.usd.conftest import write_scene
from tests.usd.models import tree_model

ROOT = Path(__file__).parents[2]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def run(code: str, *arguments: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run code in another process, where addresses and hashes differ."""
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_bytes_depend_on_the_model_alone(scene: Path, tmp_path: Path) -> None:
    here, elsewhere = write_scene(tmp_path / "a").parent, tmp_path / "other process"
    code = "import sys, pathlib; from tests.usd.conftest import write_scene; write_scene(pathlib.Path(sys.argv[1]))"
    result = run(code, elsewhere, PYTHONHASHSEED="5", PXR_WORK_THREAD_LIMIT="1", TZ="Asia/Tokyo", USER="somebody")
    assert result.returncode == 0, result.stderr
    assert contents(here) == contents(elsewhere)
    assert set(contents(here)) <= set(contents(scene.parent))


def test_writing_again_over_an_opened_asset_gives_the_same(tmp_path: Path) -> None:
    first = write_scene(tmp_path)
    before = contents(tmp_path)
    stage = Usd.Stage.Open(str(first))
    write_scene(tmp_path)
    assert contents(tmp_path) == before
    assert stage


# A limit on the size of files fails writes as a full disk does, without one.
FULL_DISK = """
import pathlib, resource, sys
from tests.usd.models import tree_model
from forestgen.usd.tree_asset import write_tree_asset
model = tree_model(n_leaves=int(sys.argv[2]))
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]),) * 2)
try:
    write_tree_asset(model, pathlib.Path(sys.argv[1]) / "oak")
except OSError as error:
    print(error)
    sys.exit(7)
"""


@pytest.mark.parametrize(
    ("n_leaves", "limit", "victim"),
    [(20_000, 100_000, "geometry.usdc"), (50, 600, ""), (0, 500, "geometry.usdc")],
)
def test_a_full_disk_is_an_error_and_leaves_no_broken_layer(
    tmp_path: Path, n_leaves: int, limit: int, victim: str
) -> None:
    result = run(FULL_DISK, tmp_path, Path(str(n_leaves)), Path(str(limit)))
    assert result.returncode == 7, result.stderr
    assert "too large" in result.stdout
    assert victim in result.stdout
    assert not list(tmp_path.rglob("*.usd*"))


def test_no_folder_to_write_to_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "trees").write_text("a file where a folder should be")
    with pytest.raises(OSError, match="trees"):
        write_tree_asset(tree_model(), tmp_path / "trees" / "oak")


def test_relative_paths() -> None:
    assert relative(Path("/a/b/c.usda"), Path("/a")) == "./b/c.usda"
    assert relative(Path("/a/b/c.usda"), Path("/a/d")) == "../b/c.usda"
    assert relative(Path("/a/..b/c.usda"), Path("/a")) == "./..b/c.usda"


def test_prim_names() -> None:
    require_prim_name("_oak_2")
    for name in ("", "2oak", "o-k", "eiche ü", "eicheü"):
        with pytest.raises(ValueError, match="is no prim name"):
            require_prim_name(name)
