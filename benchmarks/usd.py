"""How fast USD is written and read: python -m benchmarks.usd

Each line: what, seconds of processor time, its budget where there is one, and a ratio against a
plain way of doing the same, measured in this run. The slope is time a unit at the large size over
time a unit at the small one: 1 is linear. lightusd opens the scenes too, in its own environment
(.venv-lightusd, made by `make readers`), where that is there.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from time import process_time

import numpy as np
from pxr import Usd, UsdGeom  # noqa: TID251 - the plain ways are written with it

from forestgen.finishing import coarsening
from forestgen.scene.forest import Forest
from forestgen.tree.leaf_sort import sorted_leaves
from forestgen.tree.lod import LOD_STEPS, coarser_level
from forestgen.tree.model import TreeModel
from forestgen.usd.extras import Extras
from forestgen.usd.forest_scene import Instancing, write_forest
from forestgen.usd.read import read_drawables
from forestgen.usd.tree_asset import write_tree_asset
from forestgen.usd.validate import usd_findings, validate_file
from tests.tree.lod_trees import bushy_tree
from tests.usd.models import tree_model

LIGHTUSD = Path(".venv-lightusd/bin/python")
OPEN = """
import sys, time, lightusd
start = time.process_time()
lightusd.load(sys.argv[1])
print(time.process_time() - start)
"""
LEAVES, NODES, PROTOTYPES = 200_000, 6_000, 32  # so many nodes of a random tree give 80,000 triangles
KINDS: tuple[Instancing, ...] = ("native", "points")


def seconds(work: Callable[[], object], repeats: int = 3) -> float:
    """The best of a few runs."""
    best = np.inf
    for _ in range(repeats):
        start = process_time()
        work()
        best = min(best, process_time() - start)
    return float(best)


@cache
def big_tree(n_leaves: int, n_nodes: int) -> TreeModel:
    """A random tree of so many nodes, with wood as all trees have it and leaves about its twigs, kept as in a build."""
    model = bushy_tree(n_leaves, n_nodes)
    rng = np.random.default_rng(1)
    atlas = replace(model.atlas, prototypes=model.atlas.prototypes * (PROTOTYPES // len(model.atlas.prototypes)))
    leaves = replace(model.leaves, prototype=rng.integers(0, len(atlas.prototypes), n_leaves))
    return replace(model, atlas=atlas, leaves=sorted_leaves(leaves, model.skeleton))


def plain_leaves(model: TreeModel, folder: Path) -> None:
    """The same leaves as one prim each: what an instancer saves."""
    stage = Usd.Stage.CreateNew(str(folder / "plain.usdc"))
    for k in range(len(model.leaves)):
        leaf = model.atlas.prototypes[model.leaves.prototype[k]]
        mesh = UsdGeom.Mesh.Define(stage, f"/leaf_{k}")
        mesh.CreatePointsAttr(leaf.points.astype(np.float32))
        mesh.CreateFaceVertexCountsAttr([3] * len(leaf.faces))
        mesh.CreateFaceVertexIndicesAttr(leaf.faces.ravel().tolist())
        UsdGeom.Xformable(mesh).AddTranslateOp().Set(tuple(model.leaves.position[k].tolist()))
    stage.Save()


def some_forest(count: int) -> Forest:
    rng = np.random.default_rng(0)
    return Forest(
        prototypes=("oak",),
        names=tuple(f"tree_{k:05d}" for k in range(count)),
        prototype=np.zeros(count, int),
        position=rng.uniform(-300, 300, (count, 3)) * [1, 0, 1],
        yaw=rng.uniform(0, 6.28, count),
        scale=rng.uniform(0.8, 1.2, count),
    )


def plain_forest(forest: Forest, asset: Path, path: Path) -> None:
    """The same trees by the schema classes on a live stage: what Sdf in a change block saves."""
    stage = Usd.Stage.CreateNew(str(path))
    for k, name in enumerate(forest.names):
        prim = UsdGeom.Xform.Define(stage, f"/big/trees/{name}").GetPrim()
        prim.GetReferences().AddReference(str(asset))
        prim.SetInstanceable(True)
        place = UsdGeom.Xformable(prim)
        place.AddTranslateOp().Set(tuple(forest.position[k].tolist()))
        place.AddRotateYOp().Set(float(np.degrees(forest.yaw[k])))
        place.AddScaleOp().Set((float(forest.scale[k]),) * 3)
    stage.Save()


def show(what: str, time: float, note: str = "") -> None:
    print(f"{what:<52}{time:8.3f} s  {note}")


def megabytes(folder: Path) -> float:
    """The size of a tree's files, textures left out."""
    return sum(path.stat().st_size for path in folder.iterdir() if path.is_file()) / 1e6


def sizes(folder: Path) -> str:
    """What the parts of a tree take, textures left out; the 8 MB are those of the full level."""
    parts = {
        "full level": "geometry.usdc",
        "coarser levels": "lods.usdc",
        "wind": "wind.usdc",
        "guides": "guides.usdc",
        "skeleton as text": "skeleton.json",
    }
    told = (f"{name} {(folder / file).stat().st_size / 1e6:.1f}" for name, file in parts.items())
    return f"{megabytes(folder):.1f} MB: {', '.join(told)}"


def seconds_in_lightusd(path: Path) -> str:
    """How long a program that nobody here wrote takes to open a stage."""
    if not LIGHTUSD.is_file():
        return "lightusd is not there"
    told = subprocess.run([LIGHTUSD, "-c", OPEN, path], capture_output=True, text=True, check=True)
    return f"in lightusd {float(told.stdout):.3f} s"


def trees(out: Path) -> None:
    """One tree, written, read and validated; then with all that a build writes beside it."""
    model, quarter = big_tree(LEAVES, NODES), big_tree(LEAVES // 4, NODES // 4)
    few = replace(big_tree(2_000, 100), mesh=tree_model().mesh)
    large = seconds(lambda: write_tree_asset(model, out / "oak"))
    slope = large / seconds(lambda: write_tree_asset(quarter, out / "quarter")) / 4
    holds = f"{len(model.leaves) // 1000}k leaves and {len(model.mesh.faces) // 1000}k triangles of wood"
    size = f"{megabytes(out / 'oak'):.1f} of 8 MB"
    show(f"tree of {holds} written", large, f"budget 1 s, slope {slope:.2f}, {size}")
    asset = out / "oak" / "oak.usda"
    show("   read back as drawables", seconds(lambda: read_drawables(asset)))
    stage = Usd.Stage.Open(str(asset))
    usd, every = seconds(lambda: usd_findings(stage)), seconds(lambda: validate_file(asset))
    show("   validated, our own checks too", every, f"budget 2 s; USD's validators alone take {usd:.3f} s")
    levels = coarsening(model, [coarser_level(model, step) for step in LOD_STEPS])
    extras = Extras(levels, wind=True, guides=True)
    whole = seconds(lambda: write_tree_asset(model, out / "whole" / "oak", extras), 1)
    show("   with coarser levels, wind, guides", whole, sizes(out / "whole" / "oak"))
    instancer = seconds(lambda: write_tree_asset(few, out / "few"))
    prims = seconds(lambda: plain_leaves(few, out), 1)
    show("2,000 leaves as an instancer", instancer, f"a prim each takes {prims / instancer:.0f} x as long")


def forests(out: Path) -> None:
    """Many standing trees, written, opened and read."""
    assets = {"oak": write_tree_asset(tree_model(), out / "tiny")}
    plain = seconds(lambda: plain_forest(some_forest(1_000), assets["oak"], out / "plain.usda"), 1)
    large, small = some_forest(10_000), some_forest(1_000)
    for kind in KINDS:
        path, few = out / f"{kind}.usda", out / "thousand.usda"
        many = seconds(lambda: write_forest(large, assets, {}, path, "big", instancing=kind))  # noqa: B023
        ours = seconds(lambda: write_forest(small, assets, {}, few, "big", instancing=kind))  # noqa: B023
        size = f"{path.stat().st_size / 1e6:.3f} of 10 MB"
        show(f"10,000 placed trees written as {kind}", many, f"budget 2 s, slope {many / ours / 10:.2f}, {size}")
        opened = seconds(lambda: Usd.Stage.Open(str(path)))  # noqa: B023
        show("   opened", opened, f"budget 1 s; {seconds_in_lightusd(path)}")
        show("   read back as drawables", seconds(lambda: read_drawables(path), 1))  # noqa: B023
        show("   validated", seconds(lambda: validate_file(path), 1))  # noqa: B023
        show("1,000 placed trees written", ours, f"native by schema classes {plain / ours:.0f} x as long")


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        trees(Path(folder))
        forests(Path(folder))


if __name__ == "__main__":
    main()
