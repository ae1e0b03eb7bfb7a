"""Crown volume: where in space the photos allow wood and leaves, and points spread evenly in it.

The silhouettes bound the crown across each view. One photo leaves the depth open; the crown is then
taken as round: its outline is turned about the trunk, at each height with the mean of its left and
right half-widths (Tan et al. 2008 have no such bound; their turned joints keep only a loose balance).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.errors import StageError
from forestgen.tree.closing import close, dilate
from forestgen.tree.density_shape import is_one_sided
from forestgen.tree.grow.leaf_masses import LeafMasses
from forestgen.tree.grow.turned_outline import TurnedOutline, turn_outline
from forestgen.tree.scale import own_part
from forestgen.tree.strokes import fill_outline
from forestgen.tree.view import View

CLOSE = 0.02  # radius of the disc that closes a silhouette to its envelope, share of the height (as the measures do)
PASS = 0.0015  # radius of the sky gaps that wood may pass over
CROSS = 0.012  # and of those that it may cross where there is no other way to a leaf mass, and on a bare tree
LEAFY = 0.004  # radius of the gaps between leaves that count as foliage
MARGIN = 0.003  # a twig ends this much inside the foliage, so that its leaf fits
BEHIND = 0.02  # what lies this much farther off than the trunk is behind the wood that shows in the photo
SKIN = 0.03  # this near to the crown's front no limb grows: leaves must hide it, as they hide those of the photo
LONG = 0.003  # a segment longer than this could leap over a gap that no wood may cross
PLACES = 8  # of such a segment that are looked at
PROBES = 4000  # random points that measure the volume


@dataclass(frozen=True, eq=False)
class CrownVolume:
    """The space of one tree's crown."""

    cameras: tuple[Camera, ...]
    passable: tuple[NDArray[np.bool_], ...]  # a view: (H, W) where wood may pass
    crossable: tuple[NDArray[np.bool_], ...]  # a view: (H, W) where it may if there is no other way
    leafy: tuple[NDArray[np.bool_], ...]  # a view: (H, W) where a twig may end
    wooden: tuple[NDArray[np.bool_], ...]  # a view: (H, W) where it may end behind the wood that shows there
    shown: tuple[NDArray[np.bool_], ...]  # a view: (H, W) the crown as the photo shows it, its gaps left open
    turned: TurnedOutline | None  # None where the views bound the depth
    height: float  # m, of the tree
    low: NDArray[np.float64]  # (3,) box about the crown, m
    high: NDArray[np.float64]  # (3,)
    hides: bool = True  # whether leaves hide the wood behind them
    masses: LeafMasses | None = None  # where in the crown twigs may end; None: everywhere

    def allows(self, points: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Whether wood may pass at points (N, 3), and whether a twig may end there, both (N,)."""
        within = np.ones(len(points), bool) if self.turned is None else self.turned.contains(points)
        end = within if self.masses is None else self.masses.contains(points)
        pass_, end = within | end, end.copy()
        for camera, passable, leafy, wooden in zip(self.cameras, self.passable, self.leafy, self.wooden, strict=True):
            column, row = np.floor(camera.project(points)).astype(np.int64).T
            seen = (column >= 0) & (row >= 0) & (column < passable.shape[1]) & (row < passable.shape[0])
            column, row = np.where(seen, column, 0), np.where(seen, row, 0)
            pass_ &= seen & passable[row, column]
            is_behind = camera.depth(points) < -BEHIND * self.height
            end &= seen & (leafy[row, column] | (wooden[row, column] & is_behind))
        return pass_, end

    def hidden(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether wood may pass at points (N, 3), on a bare tree only where it is behind or before wood that shows."""
        passes, _ = self.allows(points)
        if not self.hides:
            for camera, shown in zip(self.cameras, self.shown, strict=True):
                column, row = np.floor(camera.project(points)).astype(np.int64).T
                passes &= shown[np.clip(row, 0, shown.shape[0] - 1), np.clip(column, 0, shown.shape[1] - 1)]
        return passes

    def into_masses(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (N, 3) moved along the first camera's rays to the nearest leaf mass."""
        if self.masses is None or not len(points):
            return points
        return self.cameras[0].unproject(self.cameras[0].project(points), self.masses.nearest_depth(points))

    def crossing(self) -> CrownVolume:
        """The same volume for wood that has no way but over sky."""
        return replace(self, passable=self.crossable)

    def spans(self, a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether the segments from points (N, 3) to points (N, 3) keep to where wood may pass in between, (N,)."""
        clear = np.ones(len(a), bool)
        length = np.linalg.norm(b - a, axis=1)
        for share in (np.arange(PLACES) + 0.5) / PLACES:
            still = np.flatnonzero(clear & (length > LONG * self.height))
            clear[still] = self.allows(a[still] + share * (b[still] - a[still]))[0]
        return clear

    def is_skin(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points (N, 3) lie where no leaf would hide a limb from the photo's camera, (N,)."""
        if self.masses is None or not self.hides:
            return np.zeros(len(points), bool)
        return self.masses.in_front(points, SKIN * self.height)

    def spacing_for(self, count: int, rng: np.random.Generator) -> float:
        """The spacing, metres, at which about `count` points fill the volume."""
        box = float(np.prod(self.high - self.low))
        share = self.allows(self.low + rng.random((PROBES, 3)) * (self.high - self.low))[1].mean()
        return float((box * max(float(share), 1 / PROBES) / count) ** (1 / 3))

    def sample(self, spacing: float, rng: np.random.Generator) -> NDArray[np.float64]:
        """Points (N, 3) spread evenly where twigs may end: one in each cell of a grid, shaken."""
        count = np.maximum(1, np.ceil((self.high - self.low) / spacing).astype(int))
        cells = np.stack(np.meshgrid(*[np.arange(n) for n in count], indexing="ij"), axis=-1).reshape(-1, 3)
        points = self.low + (cells + rng.random(cells.shape)) * spacing
        return np.asarray(points[self.allows(points)[1]])


def envelope(mask: NDArray[np.bool_], radius: float) -> NDArray[np.bool_]:
    """The closed mask (H, W) with its holes filled."""
    closed = close(mask, radius).astype(np.uint8)
    outlines, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(np.zeros_like(closed), outlines, -1, 1, cv2.FILLED) > 0)


def crown_volume(views: Sequence[View], *, is_round: bool = True) -> CrownVolume:
    """The volume of a tree's crown from its views; without `is_round` the silhouettes alone bound it.

    Raises:
        StageError: a view shows no crown.
    """
    passable, crossable, leafy, wooden, shown, outlines = [], [], [], [], [], []
    owns = [own_part(view.mattes.is_tree, view.strokes) for view in views]
    height = _height(owns[0], views[0].camera)
    for view, own in zip(views, owns, strict=True):
        unit = height * view.camera.px_per_metre
        # a bare tree's crown is what the outline holds of its wood; the trunk below grows nothing
        inside = fill_outline(view.strokes.crown, view.photo.size) if view.mattes.is_bare else view.mattes.is_foliage
        crown = own & inside
        if not crown.any():
            raise StageError(f"{view.photo.name}: no foliage or branch of this tree was found to grow into")
        shown.append(crown)
        crossable.append(close(own, CROSS * unit))
        passable.append(crossable[-1] if view.mattes.is_bare else close(own, PASS * unit))
        # of a bare tree twigs are the outline; they may lie beside the drawn ones
        ends = dilate(crown, LEAFY * unit) if view.mattes.is_bare else close(crown, LEAFY * unit)
        inner = ~dilate(~ends, MARGIN * unit)
        thin = ends & ~dilate(inner, 1.5 * MARGIN * unit)  # sprays with no inside: their twigs run along them
        leafy.append(inner | thin)
        outlines.append(envelope(crown, CLOSE * unit))
        wooden.append(outlines[-1] & own & view.mattes.is_branch & ~leafy[-1])
    is_open = is_round and is_one_sided([view.camera for view in views])
    turned = turn_outline(outlines[0], views[0].camera, height) if is_open else None
    low, high = _box(outlines, [view.camera for view in views], height)
    cameras = tuple(view.camera for view in views)
    hides = not views[0].mattes.is_bare
    return CrownVolume(
        cameras,
        tuple(passable),
        tuple(crossable),
        tuple(leafy),
        tuple(wooden),
        tuple(shown),
        turned,
        height,
        low,
        high,
        hides,
    )


def _height(own: NDArray[np.bool_], camera: Camera) -> float:
    """Metres from the root to the highest row of the tree's own matte (H, W)."""
    if not own.any():
        raise StageError("nothing of the tree was found in its photo to grow into")
    top = camera.unproject([[camera.root_px[0], float(np.flatnonzero(own.any(axis=1))[0])]])
    return max(float(top[0] @ camera.axes[1]), 1e-6)


def _box(
    outlines: Sequence[NDArray[np.bool_]], cameras: Sequence[Camera], height: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A box that surely holds the crown: heights from the first view, widths from the widest, about the trunk."""
    widest, lowest, highest = 0.0, np.inf, -np.inf
    for outline, camera in zip(outlines, cameras, strict=True):
        row, column = np.nonzero(outline)
        local = camera.unproject(np.column_stack([column + 0.5, row + 0.5])) @ camera.axes.T
        widest = max(widest, float(np.abs(local[:, 0]).max()))
        lowest, highest = min(lowest, float(local[:, 1].min())), max(highest, float(local[:, 1].max()))
    room = 0.02 * height
    return (
        np.array([-widest - room, lowest - room, -widest - room]),
        np.array([widest + room, highest + room, widest + room]),
    )
