"""A small drawn tree of known truth: skeleton -> photo with strokes and mattes. For tests of every stage.

>>> tree = drawn_tree()
>>> tree.photo.size == tree.camera.size
True
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.tree.branches import BranchGraph
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.skeleton import Skeleton, n_children
from forestgen.tree.strokes import Strokes
from forestgen.tree.view import View

FINE = 8  # subpixels along a side: circles are drawn with this precision, then averaged over 4
BARK, LEAF, SKY, GRASS = (96, 72, 50), (52, 110, 36), (150, 180, 225), (120, 130, 60)  # sRGB

#        5   9       nodes at the joints only; the drawn skeleton has more between them
#        |  /
#     4  | /  8
#      \ |/  /
#   7   \3  /
#    \   | /
#     6--2
#        1
#        0
JOINTS = np.array(
    [
        [0.0, 0.0, 0.0],
        [0.05, 1.2, 0.0],
        [0.0, 2.0, 0.0],
        [0.1, 3.2, 0.0],
        [-1.0, 4.3, 0.5],
        [0.2, 5.2, 0.0],
        [-1.2, 2.9, -0.5],
        [-1.9, 3.7, -0.7],
        [1.9, 3.8, 0.6],
        [1.1, 4.5, -0.6],
    ]
)
ABOVE = np.array([-1, 0, 1, 2, 3, 3, 2, 6, 2, 3])
WIDTH = np.array([0.16, 0.14, 0.12, 0.10, 0.04, 0.04, 0.07, 0.04, 0.04, 0.04])


@dataclass(frozen=True, eq=False)
class DrawnTree:
    """What was drawn, and the drawing."""

    skeleton: Skeleton  # the truth, metres
    camera: Camera
    photo: Photo
    strokes: Strokes
    mattes: Mattes  # the truth: share of each pixel that is leaf, and that is wood

    @property
    def branches(self) -> BranchGraph:
        """The true graph in the photo."""
        radius = self.skeleton.radius * self.camera.px_per_metre
        return BranchGraph(self.camera.project(self.skeleton.position), self.skeleton.parent, radius)

    @property
    def view(self) -> View:
        return View(self.photo, self.strokes, self.mattes, self.branches, self.camera)


def drawn_skeleton(between: int = 3) -> Skeleton:
    """The tree of the picture above, each edge cut into `between` pieces."""
    position, parent, radius, name = [JOINTS[0]], [-1], [WIDTH[0]], {0: 0}
    for joint in range(1, len(JOINTS)):
        node = name[int(ABOVE[joint])]
        start, start_width = JOINTS[ABOVE[joint]], min(WIDTH[ABOVE[joint]], 1.6 * WIDTH[joint])
        for share in np.arange(1, between + 1) / between:
            position.append(start + share * (JOINTS[joint] - start))
            radius.append(start_width + share * (WIDTH[joint] - start_width))
            parent.append(node)
            node = len(parent) - 1
        name[joint] = node
    return Skeleton(np.array(position), np.array(parent), np.array(radius))


def drawn_tree(
    *, leaves: bool = True, noise: float = 4.0, px_per_metre: float = 80.0, azimuth: float = 0.0
) -> DrawnTree:
    """Draw the tree before a sky and grass; leaves are small discs in the upper crown. A fixed seed."""
    skeleton = drawn_skeleton()
    size = (int(5.2 * px_per_metre), int(6.2 * px_per_metre))
    camera = Camera(size, (size[0] / 2, size[1] - 0.5 * px_per_metre), px_per_metre, azimuth)
    rng = np.random.default_rng(5)
    wood = draw_wood(camera.project(skeleton.position), skeleton.parent, skeleton.radius * px_per_metre, size)
    leaf = np.zeros_like(wood)
    if leaves:
        tips = np.flatnonzero(n_children(skeleton.parent) == 0)
        centre = camera.project(np.repeat(skeleton.position[tips], 60, axis=0))
        centre += rng.normal(0, 0.28 * px_per_metre, centre.shape)
        leaf = draw_discs(centre, np.full(len(centre), 0.05 * px_per_metre), size)
    wood = wood * (1 - leaf)
    row = np.arange(size[1])[:, None, None]
    scene = np.where(row < camera.root_px[1] - 0.3 * px_per_metre, SKY, GRASS) - row * 0.03
    scene = np.broadcast_to(scene, (size[1], size[0], 3))
    scene = scene * (1 - wood - leaf)[..., None] + wood[..., None] * BARK + leaf[..., None] * LEAF
    scene = scene + rng.normal(0, noise, scene.shape)
    return DrawnTree(
        skeleton=skeleton,
        camera=camera,
        photo=Photo(np.clip(np.round(scene), 0, 255).astype(np.uint8), "drawn.png"),
        strokes=drawn_strokes(camera),
        mattes=Mattes(leaf.astype(np.float32), wood.astype(np.float32)),
    )


def drawn_strokes(camera: Camera) -> Strokes:
    """What a user would draw: an outline around the crown, the trunk up to its top, one limb."""
    outline = [
        [-2.5, 3.2, 0],
        [-2.3, 4.8, 0],
        [-1, 5.3, 0],
        [0.3, 5.6, 0],
        [2, 5.4, 0],
        [2.5, 4, 0],
        [1.4, 2.9, 0],
        [-1.3, 2.4, 0],
    ]
    trunk, limb = camera.project(JOINTS[[0, 1, 2, 3, 5]]), camera.project(JOINTS[[2, 6, 7]])
    across = np.array(outline, float) @ camera.axes  # in the picture's plane, from any side
    return Strokes(camera.project(across), (trunk, limb), size=camera.size, photo="drawn.png")


def draw_wood(
    xy: NDArray[np.float64], parent: NDArray[np.int64], radius_px: NDArray[np.float64], size: tuple[int, int]
) -> NDArray[np.float64]:
    """Share (H, W) of each pixel covered by the tapering edges of a graph."""
    centre, radius = [xy[:1]], [radius_px[:1]]
    for node in range(1, len(parent)):
        share = np.linspace(0, 1, int(2 * np.hypot(*(xy[node] - xy[parent[node]]))) + 2)[:, None]
        centre.append(xy[parent[node]] + share * (xy[node] - xy[parent[node]]))
        radius.append(radius_px[parent[node]] + share[:, 0] * (radius_px[node] - radius_px[parent[node]]))
    for node in range(1, len(parent)):  # a side branch begins as thin as it goes on
        radius[node] = np.minimum(radius[node], 1.6 * radius_px[node])
    return draw_discs(np.concatenate(centre), np.concatenate(radius), size)


def draw_discs(centre: NDArray[np.float64], radius: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float64]:
    """Share (H, W) of each pixel covered by discs at centre (N, 2) px."""
    big = 4
    mask = np.zeros((size[1] * big, size[0] * big), np.uint8)
    for (x, y), r in zip(centre * big - 0.5, radius * big, strict=True):
        cv2.circle(mask, (round(x * FINE), round(y * FINE)), round(r * FINE), 1, -1, shift=3)
    return mask.reshape(size[1], big, size[0], big).mean(axis=(1, 3))
