"""How fast USD is written and read: python -m benchmarks.usd

Each line: what, seconds, the budget of DESIGN section 7 where there is one, and a ratio against a
plain way of doing the same, measured in this run. The slope is time a unit at the large size over
time a unit at the small one: 1 is linear.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
from pxr import Usd, UsdGeom  # noqa: TID251 - the plain ways are written with it

from forestgen.scene.forest import Forest
from forestgen.tree.model import Mesh, TreeModel
from forestgen.usd.forest_scene import write_forest
from forestgen.usd.read import read_drawables
from forestgen.usd.tree_asset import write_tree_asset
from forestgen.usd.validate import validate
from tests.usd.models import tree_model


def seconds(work: Callable[[], object], repeats: int = 3) -> float:
    """The best of a few runs."""
    best = np.inf
    for _ in range(repeats):
        start = perf_counter()
        work()
        best = min(best, perf_counter() - start)
    return best


def big_tree(n_leaves: int, n_triangles: int) -> TreeModel:
    """A model of the given size: wood of small triangles in a box, leaves anywhere around it."""
    rng = np.random.default_rng(1)
    n_points = n_triangles // 2
    start = rng.integers(0, n_points - 2, n_triangles)
    mesh = Mesh(
        points=rng.uniform([-1, 0, -1], [1, 3, 1], (n_points, 3)),
        normals=np.tile([0.0, 1.0, 0.0], (n_points, 1)),
        uv=np.round(rng.uniform(size=(n_points, 2)), 3),
        faces=start[:, None] + [0, 1, 2],
    )
    return tree_model(mesh=mesh, n_leaves=n_leaves, n_prototypes=32)


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


def trees(out: Path) -> None:
    """One tree, written and read."""
    model, quarter = big_tree(100_000, 200_000), big_tree(25_000, 50_000)
    few = replace(big_tree(2_000, 1_000), mesh=tree_model().mesh)
    large = seconds(lambda: write_tree_asset(model, out / "oak"))
    slope = large / seconds(lambda: write_tree_asset(quarter, out / "quarter")) / 4
    show("tree of 100k leaves and 200k triangles written", large, f"budget 1 s, slope {slope:.2f}")
    asset = out / "oak" / "oak.usda"
    show("   read back as drawables", seconds(lambda: read_drawables(asset)))
    show("   all of USD's validators", seconds(lambda: validate(asset), 1))
    instancer = seconds(lambda: write_tree_asset(few, out / "few"))
    prims = seconds(lambda: plain_leaves(few, out), 1)
    show("2,000 leaves as an instancer", instancer, f"a prim each takes {prims / instancer:.0f} x as long")


def forests(out: Path) -> None:
    """Many standing trees, written, opened and read."""
    assets = {"oak": write_tree_asset(tree_model(), out / "tiny")}
    path = out / "big.usda"
    many = seconds(lambda: write_forest(some_forest(10_000), assets, {}, path, "big"))
    ours = seconds(lambda: write_forest(some_forest(1_000), assets, {}, out / "thousand.usda", "big"))
    plain = seconds(lambda: plain_forest(some_forest(1_000), assets["oak"], out / "plain.usda"), 1)
    megabytes = path.stat().st_size / 1e6
    show("10,000 placed trees written", many, f"budget 2 s, slope {many / ours / 10:.2f}, {megabytes:.1f} of 10 MB")
    show("   opened", seconds(lambda: Usd.Stage.Open(str(path))), "budget 1 s")
    show("   read back as drawables", seconds(lambda: read_drawables(path), 1))
    show("1,000 placed trees written", ours, f"by schema classes {plain / ours:.0f} x as long")


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        trees(Path(folder))
        forests(Path(folder))


if __name__ == "__main__":
    main()
