"""Forest: which tree stands where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.scene.manifest import CopySpec, Scene, TreeSpec
from forestgen.scene.names import prim_names


@dataclass(frozen=True, eq=False)
class Forest:
    """T standing trees, each one of the prototypes. Names are prim names."""

    prototypes: tuple[str, ...]
    names: tuple[str, ...]  # (T,) all different
    prototype: NDArray[np.int64]  # (T,) into prototypes
    position: NDArray[np.float64]  # (T, 3) m
    yaw: NDArray[np.float64]  # (T,) radians about +Y
    scale: NDArray[np.float64]  # (T,) positive

    def __post_init__(self) -> None:
        freeze(
            self,
            prototype=(np.int64, "T"),
            position=(np.float64, "T", 3),
            yaw=(np.float64, "T"),
            scale=(np.float64, "T"),
        )
        if len(self.names) != len(self):
            raise ValueError(f"Forest has {len(self.names)} names for {len(self)} trees")
        if len(self) and not (self.prototype.min() >= 0 and self.prototype.max() < len(self.prototypes)):
            raise ValueError("Forest.prototype points outside Forest.prototypes")
        if not (self.scale > 0).all():
            raise ValueError("Forest.scale must be positive")

    def __len__(self) -> int:
        return len(self.prototype)


def place(scene: Scene) -> Forest:
    """The trees of a scene, then its copies, named after their tree with `_copy` (`_copy_2`, ...)."""
    index = {tree.name: k for k, tree in enumerate(scene.trees)}
    prototypes = tuple(tree.prim_name for tree in scene.trees)
    standing: list[TreeSpec | CopySpec] = [*scene.trees, *scene.copies]
    copy_names = [f"{prototypes[index[copy.of]][:50]}_copy" for copy in scene.copies]
    return Forest(
        prototypes=prototypes,
        names=tuple(prim_names([*prototypes, *copy_names])),
        prototype=np.array([*range(len(prototypes)), *(index[copy.of] for copy in scene.copies)], np.int64),
        position=np.array([one.position for one in standing], np.float64).reshape(-1, 3),
        yaw=np.array([one.heading for one in standing]),
        scale=np.array([1.0] * len(prototypes) + [copy.scale for copy in scene.copies]),
    )
