"""What a build says of itself: build.json (what was built, byte for byte repeatable) and seconds.json (how long)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from forestgen.errors import InputError
from forestgen.scene.manifest import Scene
from forestgen.scene.names import identifier

BUILD, SECONDS = "build.json", "seconds.json"
REPORT = ("report", "report.json", "report.html")


def stage_name(prim_name: str) -> str:
    """File name of a scene's stage."""
    return f"{prim_name}.usda"


def arrays_name(prim_name: str) -> str:
    """File name of the layer behind a scene's stage that holds many trees' places; few need none."""
    return f"{prim_name}_trees.usdc"


def write_record(folder: Path, scene: Scene, errors: Mapping[str, str]) -> None:
    """Write build.json: the manifest as resolved, and per tree what `check` needs. `errors`: by tree's name."""
    trees = [
        {
            "name": tree.name,
            "prim_name": tree.prim_name,
            "method": tree.method_name,
            "seed": tree.seed,
            "gates": dict(tree.gates),
            **({"error": errors[tree.name]} if tree.name in errors else {}),
        }
        for tree in scene.trees
    ]
    record = scene.resolved()
    _write(folder / BUILD, record | {"scene": record["scene"] | {"prim_name": scene.prim_name}, "trees": trees})


def write_seconds(folder: Path, seconds: Mapping[str, Mapping[str, float]]) -> None:
    """Write seconds.json: what each stage took, by tree's prim name and stage."""
    _write(folder / SECONDS, {tree: {s: round(spent, 3) for s, spent in of.items()} for tree, of in seconds.items()})


def read_seconds(folder: Path) -> dict[str, dict[str, float]]:
    """Read seconds.json; empty where it is gone.

    Raises:
        InputError: it is broken.
    """
    path = folder / SECONDS
    if not path.is_file():
        return {}
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return {tree: {stage: float(spent) for stage, spent in of.items()} for tree, of in content.items()}
    except (ValueError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: cannot be read ({error}): delete it, or build the scene again") from error


def stale_entries(out: Path, ours: Sequence[str]) -> list[str]:
    """What the earlier build in `out` wrote and is not among the names that this one will write.

    Raises:
        InputError: `out` is a file, or holds one of our names though no build wrote there.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; expected a folder to write to: choose another with -o")
    if not (out / BUILD).is_file():
        for name in ours:
            if (out / name).exists():
                raise InputError(f"{out / name}: is there already, and no build wrote it: choose another -o")
        return []
    try:
        earlier = json.loads((out / BUILD).read_text(encoding="utf-8"))
        prims = [str(entry["prim_name"]) for entry in earlier["trees"]]
        stage = str(earlier["scene"]["prim_name"])
    except (ValueError, LookupError, TypeError):
        return []  # it cannot say what it wrote, so nothing is taken for its own
    names = [f"trees/{prim}" for prim in prims if _is_ours(prim)]
    names += [stage_name(stage), arrays_name(stage)] if _is_ours(stage) else []
    return [name for name in dict.fromkeys(names) if name not in ours]


def _is_ours(prim_name: str) -> bool:
    """Whether a name found in a file is one that we could have given: never a path that leads elsewhere."""
    return bool(prim_name) and identifier(prim_name) == prim_name


def _write(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
