"""Mesh, Leaves, Atlas, Bark and the TreeModel that gathers them: what USD and the report need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View


def vertex_normals(points: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Unit normals (P, 3): the faces' normals around each point, weighted by area; +Z where there is none."""
    corner = points[faces]
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal = np.zeros_like(points)
    for k in range(3):
        np.add.at(normal, faces[:, k], area)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.where(length > 0, normal / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in metres. P points, F faces; outward winding is anticlockwise."""

    points: NDArray[np.float64]  # (P, 3) m
    normals: NDArray[np.float64]  # (P, 3) unit
    uv: NDArray[np.float64]  # (P, 2) repeats of the bark texture; v upward
    faces: NDArray[np.int64]  # (F, 3) into points

    def __post_init__(self) -> None:
        freeze(
            self,
            points=(np.float64, "P", 3),
            normals=(np.float64, "P", 3),
            uv=(np.float64, "P", 2),
            faces=(np.int64, "F", 3),
        )
        if self.faces.size and not (self.faces.min() >= 0 and self.faces.max() < len(self.points)):
            raise ValueError("Mesh.faces points outside Mesh.points")


@dataclass(frozen=True, eq=False)
class LeafPrototype:
    """One leaf in leaf space: the petiole's foot at the origin, the blade along +Y, its face to +Z.

    V vertices, F faces. The leaf is one unit long, petiole included.
    """

    points: NDArray[np.float64]  # (V, 3)
    normals: NDArray[np.float64]  # (V, 3) unit
    uv: NDArray[np.float64]  # (V, 2) in [0, 1] of the atlas, v upward
    faces: NDArray[np.int64]  # (F, 3)
    colour: NDArray[np.float64]  # (3,) mean sRGB of the leaf, in [0, 1]
    length_px: float  # how long the piece is in the photo that it was cut from, px

    def __post_init__(self) -> None:
        freeze(
            self,
            points=(np.float64, "V", 3),
            normals=(np.float64, "V", 3),
            uv=(np.float64, "V", 2),
            faces=(np.int64, "F", 3),
            colour=(np.float64, 3),
        )


@dataclass(frozen=True, eq=False)
class Atlas:
    """The leaf texture and the prototypes that use it."""

    rgba: NDArray[np.uint8]  # (H, W, 4) sRGB and straight alpha; colour bled under the edge
    prototypes: tuple[LeafPrototype, ...]

    def __post_init__(self) -> None:
        freeze(self, rgba=(np.uint8, "H", "W", 4))


@dataclass(frozen=True, eq=False)
class Leaves:
    """Instances of the atlas's prototypes. L leaves."""

    position: NDArray[np.float64]  # (L, 3) m, foot of the petiole
    orientation: NDArray[np.float64]  # (L, 4) unit quaternion, w x y z
    size: NDArray[np.float64]  # (L,) m, length of the leaf
    prototype: NDArray[np.int64]  # (L,) into Atlas.prototypes

    def __post_init__(self) -> None:
        freeze(
            self,
            position=(np.float64, "L", 3),
            orientation=(np.float64, "L", 4),
            size=(np.float64, "L"),
            prototype=(np.int64, "L"),
        )
        if len(self.size) and not np.allclose(np.linalg.norm(self.orientation, axis=1), 1, atol=1e-6):
            raise ValueError("Leaves.orientation must be unit quaternions")

    def __len__(self) -> int:
        return len(self.size)

    def take(self, index: NDArray[np.int64]) -> Leaves:
        """Some of them, or all in another order: those at index (K,)."""
        return Leaves(self.position[index], self.orientation[index], self.size[index], self.prototype[index])


@dataclass(frozen=True, eq=False)
class Bark:
    """A tileable piece of bark, or one pixel of plain colour where the photo shows too little."""

    rgb: NDArray[np.uint8]  # (H, W, 3) sRGB
    width_m: float  # how much trunk surface one repeat covers across, m
    height_m: float  # and along, m

    def __post_init__(self) -> None:
        freeze(self, rgb=(np.uint8, "H", "W", 3))


@dataclass(frozen=True, eq=False)
class TreeModel:
    """A finished tree with its provenance."""

    name: str
    method: str
    seed: int
    height: float  # m, as the manifest says
    views: tuple[View, ...]
    skeleton: Skeleton
    mesh: Mesh
    bark: Bark
    atlas: Atlas  # no prototypes where the tree is bare
    leaves: Leaves
    evergreen: bool = False  # keeps its leaves green all year
    costs: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)  # per growth iteration, by name
    seconds: Mapping[str, float] = field(default_factory=dict)  # per stage; measured by the pipeline
    notes: tuple[str, ...] = ()  # what a stage wants the user to know

    def __post_init__(self) -> None:
        if len(self.leaves) and self.leaves.prototype.max() >= len(self.atlas.prototypes):
            raise ValueError("Leaves.prototype points outside the atlas")
