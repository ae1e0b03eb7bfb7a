"""GaussianAzimuth: side branches turn about their parent's axis, evenly around it (Kim & Jeong 2014, sec. II.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import gcd
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from forestgen.errors import StageError
from forestgen.tree.branch_paths import BranchPaths, cut_into_paths
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import Strategy
from forestgen.tree.view import View

GOLDEN = (3 - 5**0.5) / 2  # share of a turn from one leaf to the next of most plants


@dataclass(frozen=True, kw_only=True)
class GaussianAzimuth(Strategy):
    """Rotation angles psi_i ~ N(mu + 2 pi (k - i) / k, sigma) of the k side branches of each branch.

    The projection must stay what was traced, so that a turn can only set depth: to the side of the
    drawn angle, as far as the branch lies off its parent's axis in the photo times |tan psi|. Near 90
    degrees this has no bound; the paper does not say where it ends.
    """

    most_views: ClassVar[int | None] = 1
    spread_deg: float = 20.0  # sigma; the paper's value is not given
    farthest: float = 0.8  # of a branch's length: depth between its foot and any node, at most; ours, see above
    steepest_deg: float = 75.0  # ours: nor is |tan psi| greater than this angle's, or a line's wiggles would grow
    neighbours_apart: bool = True  # ours: i runs over the side branches by the golden section, so that those that
    # stand next to each other are far apart ("as large as possible"); False: i counts from the parent's foot

    def __post_init__(self) -> None:
        if not self.spread_deg >= 0:
            raise ValueError(f"spread_deg is {self.spread_deg}; expected 0 or more")
        if not self.farthest >= 0:
            raise ValueError(f"farthest is {self.farthest}; expected 0 or more")
        if not 0 <= self.steepest_deg < 90:
            raise ValueError(f"steepest_deg is {self.steepest_deg}; expected 0 to below 90")

    def __call__(self, views: Sequence[View], *, rng: np.random.Generator) -> Skeleton:
        if len(views) != 1:
            raise StageError(f"gaussian_azimuth lifts one photo of a tree and came {len(views)}: choose another 'lift'")
        (view,) = views
        graph, camera = view.branches, view.camera
        flat = (graph.xy - graph.xy[0]) * [1.0, -1.0] / camera.px_per_metre
        scale = 0.02 * float(np.ptp(flat, axis=0).max())  # a direction is seen over a fiftieth of the tree
        paths = cut_into_paths(flat, graph.parent, max(scale, 1e-9))
        angle = turn_angles(paths, np.deg2rad(self.spread_deg), self.neighbours_apart, rng=rng)
        depth = turned_depth(flat, paths, angle, self.farthest, float(np.tan(np.deg2rad(self.steepest_deg))))
        return Skeleton(camera.unproject(graph.xy, depth), graph.parent, graph.radius_px / camera.px_per_metre)


def turn_angles(
    paths: BranchPaths, sigma: float, neighbours_apart: bool, *, rng: np.random.Generator
) -> NDArray[np.float64]:
    """psi (B,) of each branch about its parent's axis, radians; 0 for the trunk.

    mu is one random angle for each parent (the paper gives none): a parent with one side branch would
    keep it in the photo's plane else.
    """
    angle = np.zeros(len(paths))
    for parent in np.unique(paths.parent[1:]):
        sides = np.flatnonzero(paths.parent == parent)
        sides = sides[np.argsort(paths.base[sides], kind="stable")]  # from the foot outward
        k = len(sides)
        i = 1 + ((np.arange(k) * golden_step(k)) % k if neighbours_apart else np.arange(k))
        mu = rng.uniform(0, 2 * np.pi)
        angle[sides] = rng.normal(mu + 2 * np.pi * (k - i) / k, sigma)
    return angle


def golden_step(k: int) -> int:
    """The step, with no factor in common with k, that is nearest to the golden section of k: it meets each of k."""
    coprime = [step for step in range(1, k + 1) if gcd(step, k) == 1]
    return min(coprime, key=lambda step: abs(step - GOLDEN * k))


def turned_depth(
    flat: NDArray[np.float64], paths: BranchPaths, angle: NDArray[np.float64], farthest: float, steepest: float
) -> NDArray[np.float64]:
    """Depths (N,) toward the camera of nodes at flat (N, 2), y up, whose branches turn by angles (B,).

    A branch turns about its parent's axis as that one leans itself, and is the shallower the farther
    it would else go out of the photo's plane.
    """
    depth, lean = np.zeros(len(flat)), np.zeros(len(paths))
    for branch in paths.order[1:]:
        nodes, base = paths.nodes[branch], paths.base[branch]
        offset = flat[nodes] - flat[base]
        aside = offset @ (np.array([-1.0, 1.0]) * paths.axis[branch][::-1])
        aside *= np.sign(aside[np.argmax(np.abs(aside))])
        tangent = min(abs(np.tan(angle[branch])), steepest)
        rise = lean[paths.parent[branch]] * (offset @ paths.axis[branch])
        rise = rise + np.sign(np.sin(angle[branch])) * tangent * aside
        rise *= min(1.0, farthest * paths.length[branch] / max(float(np.abs(rise).max()), 1e-12))
        depth[nodes] = depth[base] + rise
        lean[branch] = rise[-1] / paths.length[branch]
    return depth
