"""How fast the branch mesh is, and how its cost grows: against plain tubes made piece by piece with trimesh."""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np
import trimesh

from forestgen.tree.limbs import limbs_along, thickest_child
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Bark
from forestgen.tree.skeleton import Skeleton
from tests.tree.skeletons import random_tree

BARK = Bark(np.full((1, 1, 3), 100, np.uint8), 0.5, 0.5)


def best_of(n: int, work: object) -> float:
    """Least seconds of n calls."""
    seconds = []
    for _ in range(n):
        begin = time.perf_counter()
        work()  # type: ignore[operator]
        seconds.append(time.perf_counter() - begin)
    return min(seconds)


def peer(skeleton: Skeleton) -> int:
    """Faces of plain three-sided, open, disjoint tubes, piece by piece with trimesh."""
    limbs = limbs_along(skeleton, thickest_child(skeleton))
    corner = np.exp(2j * np.pi * np.arange(3) / 3)
    count = 0
    for limb in range(len(limbs)):
        knots = limbs.node[limbs.first[limb] : limbs.first[limb + 1]]
        for a, b in pairwise(knots):
            ends = skeleton.position[[a, b]]
            frame = trimesh.geometry.align_vectors([0, 0, 1], ends[1] - ends[0])[:3, :3]
            ring = np.column_stack([corner.real, corner.imag, np.zeros(3)]) @ frame.T
            points = np.concatenate([p + skeleton.radius[k] * ring for p, k in zip(ends, (a, b), strict=True)])
            count += len(
                trimesh.Trimesh(
                    points, [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]], process=False
                ).faces
            )
    return count


def main() -> None:
    """Print seconds, triangles and ratios."""
    mesh = GeneralisedCylinders()
    print("nodes     seconds  us/node  triangles  peer seconds  ratio")
    for n in (1_250, 2_500, 5_000, 10_000, 20_000, 40_000):
        skeleton = random_tree(n, rng=np.random.default_rng(0))
        own = best_of(5, lambda s=skeleton: mesh(s, BARK))
        other = best_of(1, lambda s=skeleton: peer(s)) if n <= 5_000 else float("nan")
        faces = len(mesh(skeleton, BARK).faces)
        print(f"{n:6d}  {own:9.3f}  {own / n * 1e6:7.1f}  {faces:9d}  {other:12.2f}  {other / own:5.1f}")


if __name__ == "__main__":
    main()
