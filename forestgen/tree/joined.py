"""Several meshes as one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forestgen.tree.model import Mesh


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Meshes one after the other as one mesh.

    Raises:
        ValueError: there is none.
    """
    if not meshes:
        raise ValueError("no mesh to join")
    first = np.cumsum([0] + [len(mesh.points) for mesh in meshes[:-1]])
    return Mesh(
        points=np.concatenate([mesh.points for mesh in meshes]),
        normals=np.concatenate([mesh.normals for mesh in meshes]),
        uv=np.concatenate([mesh.uv for mesh in meshes]),
        faces=np.concatenate([mesh.faces + start for mesh, start in zip(meshes, first, strict=True)]),
    )
