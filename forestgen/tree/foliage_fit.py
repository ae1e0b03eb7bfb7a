"""Whether a leaf projects into the foliage that the photos show, and which foliage is covered yet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forestgen.tree.foliage_kernels import look_up
from forestgen.tree.leaf_scale import height_px
from forestgen.tree.model import Atlas
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View

GAP = 0.005  # share of the tree's height: grown wood this near to foliage, in its small gaps, may be hidden by leaves
THICK_PX = 0.5  # wood of at least this radius in the photo hides a leaf behind it


@dataclass(frozen=True, eq=False)
class Placement:
    """Leaves on trial. L leaves."""

    position: NDArray[np.float64]  # (L, 3) m
    rotation: NDArray[np.float64]  # (L, 3, 3) columns: where leaf space's axes go
    size: NDArray[np.float64]  # (L,) m
    prototype: NDArray[np.int64]  # (L,)

    def __len__(self) -> int:
        return len(self.size)

    def take(self, pick: NDArray[np.bool_] | NDArray[np.int64]) -> Placement:
        return Placement(self.position[pick], self.rotation[pick], self.size[pick], self.prototype[pick])


def join(parts: Sequence[Placement]) -> Placement:
    """All leaves of several placements."""
    return Placement(
        np.concatenate([p.position for p in parts]),
        np.concatenate([p.rotation for p in parts]),
        np.concatenate([p.size for p in parts]),
        np.concatenate([p.prototype for p in parts]),
    )


def blade_samples(atlas: Atlas, count: int) -> NDArray[np.float64]:
    """Points (P, count, 3) in leaf space, spread evenly over the opaque part of each prototype's blade.

    Low-discrepancy, without chance: the same atlas gives the same points.
    """
    height, width = atlas.rgba.shape[:2]
    raw = 4 * count
    step = (np.arange(raw) + 0.5) / raw
    r1, r2 = np.sqrt((np.arange(raw) * 0.7548776662) % 1.0), (np.arange(raw) * 0.5698402910) % 1.0
    samples = np.empty((len(atlas.prototypes), count, 3))
    for k, leaf in enumerate(atlas.prototypes):
        corner = leaf.points[leaf.faces]
        area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
        face = np.searchsorted(np.cumsum(area) / area.sum(), step).clip(max=len(area) - 1)
        weight = np.column_stack([1 - r1, r1 * (1 - r2), r1 * r2])
        uv = np.einsum("sk,skc->sc", weight, leaf.uv[leaf.faces[face]])
        column = (uv[:, 0] * width).astype(int).clip(0, width - 1)
        row = ((1 - uv[:, 1]) * height).astype(int).clip(0, height - 1)
        there = np.flatnonzero(atlas.rgba[row, column, 3] >= 128)
        there = there if len(there) else np.arange(raw)
        pick = there[np.linspace(0, len(there) - 1, count).round().astype(int)]
        samples[k] = np.einsum("sk,skc->sc", weight[pick], corner[face[pick]])
    return samples


@dataclass(eq=False)
class Target:
    """One view's foliage as leaves see it: what may be covered, how deep wood lies, and what is covered."""

    view: View
    is_foliage: NDArray[np.bool_]  # (H, W) where leaves belong: foliage, and grown wood that the photo does not show
    is_wood: NDArray[np.bool_]  # (H, W) wood that the photo shows: leaves stay behind it
    wood_depth: NDArray[np.float32]  # (H, W) m towards the camera; -inf where there is no wood
    is_grown: NDArray[np.bool_]  # (H, W) wood that the photo does not show: leaves should hide it
    is_covered: NDArray[np.bool_] = field(init=False)  # (H, W) by a leaf, and not by wood before it

    def __post_init__(self) -> None:
        self.is_covered = np.zeros(self.is_foliage.shape, bool)

    @property
    def open(self) -> NDArray[np.bool_]:
        """Foliage that no leaf covers yet (H, W)."""
        return self.is_foliage & ~self.is_covered


def make_target(view: View, skeleton: Skeleton) -> Target:
    """What a view asks of the leaves: its foliage covered, its visible wood left bare."""
    is_wood = view.mattes.is_branch & ~view.mattes.is_foliage
    depth = draw_wood(view, skeleton)
    near = cv2.distanceTransform((~view.mattes.is_foliage).astype(np.uint8), cv2.DIST_L2, 3) <= GAP * height_px(view)
    is_grown = np.isfinite(draw_wood(view, skeleton, 0.0)) & ~is_wood & near
    blank = is_wood & np.isneginf(depth)
    if blank.any() and not blank.all():  # wood of the photo that the skeleton misses is as deep as the nearest it has
        column, row = np.meshgrid(np.arange(depth.shape[1]), np.arange(depth.shape[0]))
        known = np.isfinite(depth)
        if known.any():
            tree = cKDTree(np.column_stack([column[known], row[known]]))
            _, nearest = tree.query(np.column_stack([column[blank], row[blank]]))
            depth[blank] = depth[known][nearest]
    return Target(view, view.mattes.is_foliage | is_grown, is_wood, depth, is_grown)


def draw_wood(view: View, skeleton: Skeleton, least_px: float = THICK_PX) -> NDArray[np.float32]:
    """How near to the camera (H, W) the front of the wood is, metres; -inf where there is none.

    Wood thinner than `least_px` (radius) is left out. Each edge is drawn as a stroke as wide as its
    end, from the farthest to the nearest.
    """
    camera = view.camera
    depth = np.full(view.mattes.foliage.shape, -np.inf, np.float32)
    radius = np.nan_to_num(skeleton.radius)
    xy = np.round((camera.project(skeleton.position) - 0.5) * 16).astype(np.int32)
    far = camera.depth(skeleton.position)
    thick = 1 + np.flatnonzero(radius[1:] * camera.px_per_metre >= least_px)
    near = np.maximum(far[thick], far[skeleton.parent[thick]])
    for k in np.argsort(near, kind="stable"):
        node = int(thick[k])
        above = int(skeleton.parent[node])
        width = max(1, round(2 * radius[node] * camera.px_per_metre))
        front = float((far[node] + far[above]) / 2 + radius[node])
        start, end = xy[above].tolist(), xy[node].tolist()
        cv2.line(depth, start, end, front, width, cv2.LINE_8, 4)
    return depth


@dataclass(frozen=True, eq=False)
class Footprint:
    """Where leaves fall in a view: as shares of each leaf (L,), and its pixels (L, S) as flat indices."""

    inside: NDArray[np.float64]  # over foliage, or hidden behind wood
    gain: NDArray[np.float64]  # over foliage that was open, in front of wood
    pixel: NDArray[np.int64]  # (L, S); -1 outside the frame or behind wood


def footprint(target: Target, leaves: Placement, samples: NDArray[np.float64]) -> Footprint:
    """Look leaves up in a view. The projection of one leaf is taken as affine: exact without a focal length."""
    camera = target.view.camera
    n = len(leaves)
    axis = leaves.rotation * leaves.size[:, None, None]
    ends = leaves.position[:, None] + np.swapaxes(axis, 1, 2)
    base = camera.project(leaves.position)
    step = camera.project(ends.reshape(-1, 3)).reshape(n, 3, 2) - base[:, None]
    toward = np.einsum("lik,i->lk", axis, camera.axes[2])
    inside, gain = np.empty(n), np.empty(n)
    pixel = np.empty((n, samples.shape[1]), np.int64)
    look_up(
        samples,
        leaves.prototype,
        base,
        step,
        camera.depth(leaves.position),
        toward,
        target.is_foliage,
        target.open,
        target.wood_depth,
        inside,
        gain,
        pixel,
    )
    return Footprint(inside, gain, pixel)


def cover(target: Target, pixel: NDArray[np.int64]) -> None:
    """Note the pixels (L, S) of kept leaves as covered."""
    flat = pixel.ravel()
    target.is_covered.ravel()[flat[flat >= 0]] = True
