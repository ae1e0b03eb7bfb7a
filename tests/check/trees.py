"""A small tree whose photo is its own render: every measure of it is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from forestgen.camera import Camera
from forestgen.check.score import HALF
from forestgen.render import Studio
from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.model import Atlas, Bark, LeafPrototype, Leaves, Mesh, TreeModel
from forestgen.tree.photo import Photo
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strokes import DensityStroke, Strokes
from forestgen.tree.view import View
from forestgen.usd.read import read_drawables
from forestgen.usd.tree_asset import write_tree_asset

HEIGHT = 5.0
CAMERA = Camera(size=(220, 260), root_px=(104.5, 245.0), px_per_metre=45.0)


def post(width: float, height: float) -> Mesh:
    """A flat post that faces the camera, in two triangles."""
    x = width / 2
    points = np.array([[-x, 0, 0], [x, 0, 0], [x, height, 0], [-x, height, 0]])
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    return Mesh(points, np.tile([0.0, 0.0, 1.0], (4, 1)), uv, np.array([[0, 1, 2], [0, 2, 3]]))


def leaf_atlas() -> Atlas:
    """Two leaves, dark and light green, round in their squares."""
    rows, columns = np.mgrid[:32, :32]
    alpha = (np.hypot(rows - 15.5, columns - 15.5) < 15) * 255
    colours = ((40, 90, 30), (120, 170, 60))
    cells = [np.dstack([np.tile(np.array(c, np.uint8), (32, 32, 1)), alpha]) for c in colours]
    prototypes = tuple(
        LeafPrototype(
            points=np.array([[-0.5, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [-0.5, 1, 0]]),
            normals=np.tile([0.0, 0.0, 1.0], (4, 1)),
            uv=np.array([[k / 2, 0], [(k + 1) / 2, 0], [(k + 1) / 2, 1], [k / 2, 1]]),
            faces=np.array([[0, 1, 2], [0, 2, 3]]),
            colour=np.array(colour) / 255,
            length_px=20.0,
        )
        for k, colour in enumerate(colours)
    )
    return Atlas(np.hstack(cells).astype(np.uint8), prototypes)


def crown_leaves(rng: np.random.Generator, n: int = 300) -> Leaves:
    """Leaves that face the camera, in a disc around (0, 3.5, 0) in front of the post, and one on top."""
    turn, reach = rng.uniform(0, 2 * np.pi, n), 1.3 * np.sqrt(rng.random(n))
    position = np.column_stack([reach * np.cos(turn), 3.4 + reach * np.sin(turn), rng.uniform(0.2, 0.5, n)])
    position[0] = [0, HEIGHT - 0.25, 0.3]
    unturned = np.tile([1.0, 0, 0, 0], (n, 1))
    return Leaves(position, unturned, np.full(n, 0.25), rng.integers(0, 2, n))


def tree_model(folder: Path, *, bare: bool = False, name: str = "small") -> TreeModel:
    """The tree; its asset is written to `folder` so that its view can be taken from it."""
    rng = np.random.default_rng(5)
    skeleton = Skeleton(
        np.array([[0, 0, 0], [0, 2, 0], [0, 3.5, 0]], float), np.array([-1, 0, 1]), np.array([0.2, 0.15, 0.1])
    )
    empty = Leaves(np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(0), np.zeros(0, int))
    model = TreeModel(
        name=name,
        method="tan2008",
        seed=3,
        height=HEIGHT,
        views=(),
        skeleton=skeleton,
        mesh=post(0.4, HEIGHT if bare else 3.5),
        bark=Bark(np.full((4, 4, 3), (110, 80, 50), np.uint8), 1.0, 1.0),
        atlas=Atlas(np.zeros((1, 1, 4), np.uint8), ()) if bare else leaf_atlas(),
        leaves=empty if bare else crown_leaves(rng),
        costs={"image_cost": np.array([9.0, 4.0, np.nan, 1.0])},
        seconds={"grow": 0.25},
        notes=("a note with <b>markup</b>",),
    )
    written = write_tree_asset(model, folder / "small")
    return replace(model, views=(own_view(written, bare),))


def own_view(written: Path, bare: bool) -> View:
    """The view whose photo, mattes and trace are those of the tree itself."""
    with Studio(read_drawables(written)) as studio:
        colour, front = studio.colour(CAMERA), studio.classes(CAMERA)
    share = colour[..., 3:]
    sky = np.array([0.7, 0.8, 1.0])
    solid = np.where(share >= HALF, colour[..., :3] / np.maximum(share, 1e-6), sky)
    top = HEIGHT if bare else 3.5
    middle = CAMERA.project([[0, 0, 0], [0, 2.2, 0], [0, top, 0]])
    return View(
        photo=Photo((solid * 255).round().astype(np.uint8), "photos/small tree.jpg"),
        strokes=Strokes(
            crown=np.array([[30.0, 10.0], [180.0, 10.0], [180.0, 160.0], [30.0, 160.0]]),
            branches=(middle[:2],),
            background=(np.array([[5.0, 5.0], [20.0, 5.0]]),),
            density=(DensityStroke(True, 6.0, np.array([[50.0, 50.0], [60.0, 60.0]])),),
            size=CAMERA.size,
        ),
        mattes=Mattes(np.where(front[..., 0] >= HALF, 1, 0), np.where(front[..., 1] >= HALF, 1, 0)),
        branches=BranchGraph(middle, np.array([-1, 0, 1]), np.array([9.0, np.nan, 6.0])),
        camera=CAMERA,
    )
