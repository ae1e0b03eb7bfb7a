"""Small trees with known truth for the USD tests."""

from __future__ import annotations

import numpy as np

from forestgen.camera import Camera
from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.model import Atlas, Bark, LeafPrototype, Leaves, Mesh, TreeModel
from forestgen.tree.photo import Photo
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strokes import Strokes
from forestgen.tree.view import View


def box_mesh(width: float, height: float) -> Mesh:
    """A box standing on the root, corners shared: 8 points, 12 triangles."""
    x = width / 2
    points = np.array([[sx * x, y, sz * x] for y in (0, height) for sz in (1, -1) for sx in (-1, 1)], float)
    quads = [[0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6], [4, 5, 7, 6], [2, 3, 1, 0]]
    faces = [f for a, b, c, d in quads for f in ([a, b, c], [a, c, d])]
    normals = points - points.mean(axis=0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(points, normals, points[:, :2] * 2, np.array(faces))


def leaf_prototype(k: int, n: int) -> LeafPrototype:
    """A triangle one unit long that uses the k-th of n columns of the atlas; it leans to +X as k grows."""
    points = np.array([[-0.2, 0.0, 0.0], [0.2 + 0.1 * k, 0.5, 0.0], [0.0, 1.0, 0.05]])
    u = np.array([0.1, 0.9, 0.5])
    return LeafPrototype(
        points=points,
        normals=np.tile([0.0, 0.0, 1.0], (3, 1)),
        uv=np.column_stack([(k + u) / n, [0.1, 0.5, 0.9]]),
        faces=np.array([[0, 1, 2]]),
        colour=np.array([0.3, 0.5, 0.2]),
        length_px=20.0,
    )


def random_leaves(n: int, n_prototypes: int, rng: np.random.Generator) -> Leaves:
    """Leaves anywhere in a crown of 2 m, turned anyhow."""
    turn = rng.normal(size=(n, 4))
    return Leaves(
        position=rng.uniform([-1, 1, -1], [1, 3, 1], (n, 3)),
        orientation=turn / np.linalg.norm(turn, axis=1, keepdims=True),
        size=rng.uniform(0.05, 0.2, n),
        prototype=rng.integers(0, n_prototypes, n),
    )


def atlas(n: int, rng: np.random.Generator) -> Atlas:
    """n prototypes over a picture of noise, opaque in the middle of each column."""
    rgba = rng.integers(0, 255, (32, 16 * n, 4), dtype=np.uint8)
    rgba[..., 3] = np.where(np.abs(np.arange(16 * n) % 16 - 7.5) < 5, 255, 0)
    return Atlas(rgba, tuple(leaf_prototype(k, n) for k in range(n)))


def view(camera: Camera) -> View:
    """A view of nothing in particular through a camera."""
    width, height = camera.size
    empty = np.zeros((height, width), np.float32)
    trunk = np.array([[width / 2, height - 2.0], [width / 2, height / 2]])
    return View(
        photo=Photo(np.zeros((height, width, 3), np.uint8), "a.jpg"),
        strokes=Strokes(np.array([[1.0, 1.0], [width - 1, 1.0], [width / 2, height / 2]]), (trunk,)),
        mattes=Mattes(empty, empty),
        branches=BranchGraph(trunk, np.array([-1, 0]), np.array([2.0, 1.0])),
        camera=camera,
    )


def tree_model(
    *,
    leaves: Leaves | None = None,
    n_leaves: int = 50,
    n_prototypes: int = 3,
    mesh: Mesh | None = None,
    name: str = "oak",
) -> TreeModel:
    """A box for a trunk, and leaves; `n_leaves=0` gives a bare tree."""
    rng = np.random.default_rng(7)
    if leaves is None:
        leaves = random_leaves(n_leaves, n_prototypes, rng)
    return TreeModel(
        name=name,
        method="tan2008",
        seed=7,
        height=4.0,
        views=(
            view(Camera((60, 80), (20.5, 77.25), 18.0)),
            view(Camera((81, 50), (50.0, 45.5), 11.0, np.radians(70), np.radians(12))),
            view(Camera((90, 120), (30.0, 110.0), 21.0, np.radians(-33), np.radians(-5), focal_px=140.0)),
        ),
        skeleton=Skeleton(np.array([[0, 0, 0], [0, 2.0, 0]]), np.array([-1, 0]), np.array([0.1, 0.1])),
        mesh=box_mesh(0.3, 2.0) if mesh is None else mesh,
        bark=Bark(rng.integers(0, 255, (16, 8, 3), dtype=np.uint8), 0.3, 0.6),
        atlas=atlas(n_prototypes, rng) if len(leaves) else Atlas(np.zeros((1, 1, 4), np.uint8), ()),
        leaves=leaves,
    )
