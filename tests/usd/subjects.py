"""A written tree with levels of detail, alone and in a scene: what profiles are made from."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from forestgen.camera import Camera
from forestgen.tree.level import EMPTY_MESH, NO_LEAVES, Level
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Atlas, Bark, LeafPrototype, Leaves, TreeModel
from forestgen.usd.cameras import write_cameras
from forestgen.usd.extras import Extras
from forestgen.usd.forest_scene import Instancing, write_forest
from forestgen.usd.tree_asset import write_tree_asset
from tests.tree.skeletons import random_tree
from tests.usd.conftest import FOREST
from tests.usd.models import box_mesh, tree_model, view

CELL = 64  # px of a leaf in the atlas
CAMERA = Camera((420, 480), (210.0, 455.0), 105.0, np.radians(20), np.radians(8))


def leafy_model(name: str = "oak", n_leaves: int = 600) -> TreeModel:
    """A random tree whose leaves are cut out of squares by their texture's alpha; of about 4 m."""
    rng = np.random.default_rng(11)
    skeleton = random_tree(200, rng=rng)
    grown = 4.0 / np.ptp(skeleton.position[:, 1])
    skeleton = type(skeleton)(skeleton.position * grown, skeleton.parent, skeleton.radius * grown)
    turn = rng.normal(size=(n_leaves, 4))
    node = rng.integers(40, 200, n_leaves)
    few = tree_model(n_leaves=0, name=name)
    bark = Bark(few.bark.rgb, 0.5, 0.5)
    return TreeModel(
        name=name,
        method="tan2008",
        seed=11,
        height=4.0,
        views=(view(CAMERA),),
        skeleton=skeleton,
        mesh=GeneralisedCylinders()(skeleton, bark),
        bark=bark,
        atlas=leaf_atlas(rng),
        leaves=Leaves(
            position=skeleton.position[node] + rng.normal(0, 0.03, (n_leaves, 3)),
            orientation=turn / np.linalg.norm(turn, axis=1, keepdims=True),
            size=rng.uniform(0.2, 0.4, n_leaves),
            prototype=rng.integers(0, 2, n_leaves),
        ),
    )


def leaf_atlas(rng: np.random.Generator) -> Atlas:
    """Two leaves side by side: an ellipse, and a ring, whose hole is leaf colour seen through."""
    rgba = rng.integers(60, 200, (CELL, 2 * CELL, 4), dtype=np.uint8)
    y, x = (np.mgrid[:CELL, :CELL] + 0.5) / CELL * 2 - 1
    away = np.hypot(x / 0.7, y / 0.95)
    rgba[..., 3] = 255 * np.hstack([away < 1, (away < 1) & (away > 0.4)])
    return Atlas(rgba, tuple(square_leaf(k) for k in range(2)))


def square_leaf(k: int) -> LeafPrototype:
    """A square one unit long over the k-th cell of two."""
    u, v = np.array([0.0, 1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0])
    return LeafPrototype(
        points=np.column_stack([u - 0.5, v, np.zeros(4)]),
        normals=np.tile([0.0, 0.0, 1.0], (4, 1)),
        uv=np.column_stack([(k + u) / 2, v]),
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
        colour=np.array([0.4, 0.5, 0.4]),
        length_px=float(CELL),
    )


def levels(model: TreeModel) -> Extras:
    """A third of the leaves, larger; then a box of cards around a plain trunk."""
    few = np.arange(0, len(model.leaves), 3)
    leaves = model.leaves
    thinned = Leaves(leaves.position[few], leaves.orientation[few], leaves.size[few] * 1.7, leaves.prototype[few])
    cards = box_mesh(2.0, 3.5)
    return Extras(
        levels=(
            Level(box_mesh(0.3, 3.0), thinned, model.atlas.prototypes, EMPTY_MESH, 400.0),
            Level(box_mesh(0.2, 2.0), NO_LEAVES, (), cards, 100.0),
        ),
        pictures={"leaf_cards": np.full((8, 8, 4), 200, np.uint8)},
        wind=True,
        guides=True,
    )


SUBJECTS = {"oak": "out/trees/oak", "bare": "out/trees/bare", "wood": "out", "points": "points"}  # below a folder


def write_subjects(folder: Path) -> Path:
    """Write both scenes that SUBJECTS tells of, one by prims and one by an instancer; give that of `out`."""
    write_subject(folder / "out")
    write_subject(folder / "points", "points")
    return folder / "out"


def write_subject(folder: Path, instancing: Instancing = "auto") -> Path:
    """Write OUT/trees/oak (three levels) and OUT/trees/bare (one), and a scene of both; give its path."""
    assets, cameras = {}, {}
    for name, model in (("oak", leafy_model()), ("bare", tree_model(n_leaves=0, name="bare"))):
        home = folder / "trees" / name
        assets[name] = write_tree_asset(model, home, levels(model) if name == "oak" else None)
        cameras[name] = write_cameras(model, home)
    return write_forest(FOREST, assets, cameras, folder / "wood.usda", "wood", instancing=instancing)
