"""Leaf masses: the lobes that a crown is made of, laid out in space as rough as the photo's outline is.

One photo shows the lobes of two sides only. The others get their like: the outline's own unevenness,
its phases drawn anew, runs round the trunk, and balls as large as the outline's lobes are packed in it,
with gaps between; in front of the camera they cover what the photo shows as foliage and nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from forestgen.camera import Camera
from forestgen.tree.grow.turned_outline import TurnedOutline

CELL = 0.010  # of the height: edge of the cells that the masses are kept in
SIZES = (0.03, 0.045, 0.06, 0.08, 0.10)  # of the height: radii that lobes are measured with
RIM = 0.06  # of the height: so near to the outline the lobes are measured
TRENDS = 0.12  # of the crown's height: what is longer is the crown's form, what is shorter its lobes
WAVES = 14  # of the outline's unevenness, longest first
ROUGHEST = 0.22  # of the half-width: no rougher is the unseen side
APART = 0.62  # of the sum of two masses' radii: their middles are no nearer
SUNK = 0.62  # of a mass's radius lies inside the hull
FLAT = 0.85  # height of a mass over its width
SPRAY = 0.5  # and of a conifer's
EVEN = 0.07  # of the crown's height, of the hull's depth: notches are drawn anew
SWAY = 0.07  # of the crown's height, by which the profile is higher or lower in other directions
DARTS = 6000  # places that are tried
FINEST = 0.016  # of the height: radius of the smallest mass


@dataclass(frozen=True, eq=False)
class LeafMasses:
    """Balls of foliage, and the cells they fill."""

    centre: NDArray[np.float64]  # (L, 3) m
    radius: NDArray[np.float64]  # (L,) m
    axes: NDArray[np.float64]  # (3, 3) of the cells: right, up, toward the camera
    low: NDArray[np.float64]  # (3,) m, corner of the cells
    cell: float  # m
    filled: NDArray[np.bool_]  # (X, Y, Z)
    front: NDArray[np.float64]  # (X, Y) m toward the camera, of the foremost foliage; -inf where there is none

    def contains(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points (N, 3) lie in a mass (N,)."""
        index, inside = self._cell_of(points)
        return np.asarray(inside & self.filled[index[:, 0], index[:, 1], index[:, 2]], bool)

    def in_front(self, points: NDArray[np.float64], skin: float) -> NDArray[np.bool_]:
        """Whether points (N, 3) have less than `skin` metres of crown between them and the camera, but have some."""
        index, inside = self._cell_of(points)
        front = self.front[index[:, 0], index[:, 1]]
        return np.asarray(inside & np.isfinite(front) & (points @ self.axes[2] > front - skin), bool)

    def nearest_depth(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """How near to the camera (N,), m, the foliage is that is nearest to points (N, 3) before or behind them."""
        index, inside = self._cell_of(points)
        column = self.filled[index[:, 0], index[:, 1]]
        away = np.where(column, np.abs(np.arange(column.shape[1]) - index[:, 2:]), column.shape[1])
        own: NDArray[np.float64] = points @ self.axes[2]
        found = self.low[2] + (away.argmin(axis=1) + 0.5) * self.cell
        return np.asarray(np.where(inside & column.any(axis=1), found, own))

    def _cell_of(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        index = np.floor((points @ self.axes.T - self.low) / self.cell).astype(np.int64)
        inside = np.asarray(((index >= 0) & (index < self.filled.shape)).all(axis=1), bool)
        return np.where(inside[:, None], index, 0), inside


def leaf_masses(
    leafy: NDArray[np.bool_],
    camera: Camera,
    hull: Hull,
    sizes: NDArray[np.float64],
    height: float,
    limbs: NDArray[np.float64],
    *,
    rng: np.random.Generator,
) -> LeafMasses:
    """The masses of a crown that a view shows as foliage (H, W); some hold the visible limbs' outer nodes (K, 3)."""
    room = room_in(leafy, camera)
    centre, radius = pack(room, camera, hull, sizes, limbs, height, rng=rng)
    centre, radius = cover(leafy, room, camera, hull.turned, centre, radius, height)
    return fill_cells(centre, radius, FLAT, camera.axes, CELL * height)


def tiers(
    leafy: NDArray[np.bool_],
    camera: Camera,
    turned: TurnedOutline,
    height: float,
    boughs: NDArray[np.float64],
    width: NDArray[np.float64],
) -> LeafMasses:
    """The masses of a crown of boughs: flat ones about the boughs' nodes (K, 3), as wide as told (K,), metres."""
    room = room_in(leafy, camera)
    centre, radius = cover(leafy, room, camera, turned, boughs, width, height)
    return fill_cells(centre, radius, SPRAY, camera.axes, CELL * height)


def room_in(leafy: NDArray[np.bool_], camera: Camera) -> NDArray[np.float64]:
    """How far each pixel (H, W) of a mask is from its outline, metres."""
    away = cv2.distanceTransform(np.pad(leafy, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    return np.asarray(away / camera.px_per_metre, np.float64)


def lobe_sizes(leafy: NDArray[np.bool_], px_per_metre: float, height: float) -> NDArray[np.float64]:
    """Radii, metres, of the lobes along a mask's (H, W) outline: each as often as it is met there.

    A place of the rim belongs to the largest disc that fits into the mask and holds it.
    """
    shrink = min(1.0, 150 / (height * px_per_metre))  # discs of a few pixels are measured fast
    small = cv2.resize(leafy.astype(np.uint8), None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    small = np.pad(cv2.morphologyEx(small, cv2.MORPH_CLOSE, _disc(2)), 20)
    unit = height * px_per_metre * shrink
    away = cv2.distanceTransform(small, cv2.DIST_L2, 5)
    rim: NDArray[np.bool_] = (small > 0) & (away < RIM * unit)
    share = [np.count_nonzero(cv2.morphologyEx(small, cv2.MORPH_OPEN, _disc(s * unit))[rim]) for s in SIZES]
    many = -np.diff([max(np.count_nonzero(rim), 1), *share[1:], 0])
    return np.repeat(SIZES, np.maximum(1, np.rint(50 * many / max(many.sum(), 1))).astype(int)) * height


def _disc(radius: float) -> NDArray[np.uint8]:
    size = 2 * int(np.ceil(radius)) + 1
    y, x = np.mgrid[:size, :size] - size // 2
    return np.asarray(np.hypot(x, y) <= radius, np.uint8)


@dataclass(frozen=True, eq=False)
class Hull:
    """The turned outline with lobes: wider or narrower, higher or lower, by azimuth about the trunk. W waves."""

    turned: TurnedOutline
    size: NDArray[np.float64]  # (W,) of the waves along the height, longest first, as shares of the half-width
    phase: NDArray[np.float64]  # (W,)
    round: NDArray[np.float64]  # (W,) periods about the trunk
    sway: NDArray[np.float64]  # (2,) phases of the swaying

    @classmethod
    def of(cls, turned: TurnedOutline, even: float = EVEN, *, rng: np.random.Generator) -> Hull:
        """The waves of both halves of the outline, each with a new phase that advances with the azimuth."""
        power = np.zeros(WAVES)
        for half in (turned.left, turned.right):
            form = gaussian_filter1d(half, TRENDS * len(half), mode="nearest")
            uneven = (half - form) / max(float(half.mean()), 1e-9)
            power += np.abs(2 * np.fft.rfft(uneven) / len(half))[1 : WAVES + 1] ** 2 / 2
        size = np.sqrt(power)
        size *= min(1.0, ROUGHEST / max(float(np.sqrt((size**2).sum() / 2)), 1e-9))
        turn = rng.choice([-3, -2, -1, 1, 2, 3], WAVES).astype(float)
        smooth = replace(turned, depth=gaussian_filter1d(turned.depth, even * len(turned.depth), mode="nearest"))
        return cls(smooth, size, rng.uniform(0, 2 * np.pi, WAVES), turn, rng.uniform(0, 2 * np.pi, 2))

    def reach(self, local: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far from the trunk's plane the hull reaches (N,) at points (N, 3) in the camera's axes, metres."""
        azimuth = self.turned.azimuth(local)
        return self._uneven(azimuth, local[:, 1]) * self.turned.reach(local[:, 0], self._swayed(azimuth, local[:, 1]))

    def radius(self, azimuth: NDArray[np.float64], up: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far from the trunk the hull reaches (N,) at azimuths (N,), radians, and heights (N,), metres."""
        row = self.turned.row(self._swayed(azimuth, up))
        side = np.where(np.cos(azimuth) < 0, self.turned.left[row], self.turned.right[row])
        across, toward = (
            np.cos(azimuth) / np.maximum(side, 1e-9),
            np.sin(azimuth) / np.maximum(self.turned.depth[row], 1e-9),
        )
        uneven = 1 + (self._uneven(azimuth, up) - 1) * np.sin(azimuth) ** 2  # at both sides the outline is seen
        return np.asarray(uneven / np.hypot(across, toward))

    def _uneven(self, azimuth: NDArray[np.float64], up: NDArray[np.float64]) -> NDArray[np.float64]:
        low, high = self.turned.up[0], self.turned.up[-1]
        wave = 2 * np.pi * np.arange(1, WAVES + 1) * ((up - low) / (high - low))[:, None]
        return np.asarray(1 + (self.size * np.cos(wave + self.round * azimuth[:, None] + self.phase)).sum(axis=1))

    def _swayed(self, azimuth: NDArray[np.float64], up: NDArray[np.float64]) -> NDArray[np.float64]:
        """The heights (N,) whose profile stands at azimuths (N,) and heights (N,)."""
        low, high = self.turned.up[0], self.turned.up[-1]
        share = (up - low) / (high - low)
        inside = np.clip(4 * share * (1 - share), 0, 1)  # the top and the foot stay
        sway = SWAY * np.sin(azimuth) ** 2 * np.cos(azimuth[:, None] * [1, 2] + self.sway).sum(axis=1)
        return np.asarray(up + sway * inside * (high - low))


def pack(
    room: NDArray[np.float64],
    camera: Camera,
    hull: Hull,
    sizes: NDArray[np.float64],
    limbs: NDArray[np.float64],
    height: float,
    *,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Middles (L, 3) and radii (L,) of masses in the hull, one about each visible limb's end first.

    `room` (H, W) is how far the foliage's outline is, metres: a mass is no larger in the picture.
    """
    turned = hull.turned
    low = np.array([-turned.left.max() + turned.centre.min(), turned.up[0], -1.3 * turned.depth.max()])
    high = np.array([turned.right.max() + turned.centre.max(), turned.up[-1], 1.3 * turned.depth.max()])
    darts = low + rng.random((DARTS, 3)) * (high - low)
    radius = np.concatenate([rng.choice(sizes, len(limbs)), rng.choice(sizes, DARTS)])
    place = np.concatenate([limbs @ camera.axes.T, darts])
    fits = np.maximum(_at(room, camera, place @ camera.axes), 0)
    is_limb = np.arange(len(place)) < len(limbs)
    radius = np.minimum(radius, 1.15 * fits)
    kept = (radius >= FINEST * height) & (is_limb | (np.abs(place[:, 2]) <= hull.reach(place) - SUNK * radius))
    place, radius = place[kept], radius[kept]
    chosen = apart(place, radius)
    return place[chosen] @ camera.axes, radius[chosen]


def apart(place: NDArray[np.float64], radius: NDArray[np.float64]) -> NDArray[np.int64]:
    """Which balls stay, in order, when one too near to an earlier one that stays is left out."""
    if not len(place):
        return np.zeros(0, np.int64)
    near = cKDTree(place).query_ball_point(place, 2 * APART * radius.max())
    stays = np.zeros(len(place), bool)
    for one, others in enumerate(near):
        earlier = np.array([k for k in others if k < one and stays[k]], np.int64)
        gap = np.linalg.norm(place[earlier] - place[one], axis=1)
        stays[one] = bool((gap >= APART * (radius[earlier] + radius[one])).all())
    return np.flatnonzero(stays)


def cover(
    leafy: NDArray[np.bool_],
    room: NDArray[np.float64],
    camera: Camera,
    turned: TurnedOutline,
    centre: NDArray[np.float64],
    radius: NDArray[np.float64],
    height: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The masses and as many more as cover the foliage (H, W) in the picture, as deep as those beside them."""
    scale = camera.px_per_metre
    open_ = leafy.astype(np.uint8)
    for xy, r in zip(camera.project(centre), radius, strict=True):
        cv2.circle(open_, (round(xy[0]), round(xy[1])), round(FLAT * r * scale), 0, -1)
    step = max(1, int(0.4 * FINEST * height * scale))
    row, column = (v.ravel() for v in np.mgrid[step // 2 : leafy.shape[0] : step, step // 2 : leafy.shape[1] : step])
    order = np.argsort(-room[row, column], kind="stable")  # large ones first
    places, radii = [*centre], [*radius]
    pixels = [*camera.project(centre)]
    for y, x in zip(row[order], column[order], strict=True):
        if not open_[y, x]:
            continue
        r = float(np.clip(room[y, x], FINEST * height, SIZES[2] * height))
        beside = int(np.argmin(((np.array(pixels) - (x, y)) ** 2).sum(axis=1))) if pixels else -1
        toward = float(camera.depth(places[beside][None])[0]) if pixels else 0.0
        at = camera.unproject([[x + 0.5, y + 0.5]], toward)
        local = at @ camera.axes.T
        deep = max(float(turned.reach(local[:, 0], local[:, 1])[0]) - SUNK * r, 0.0)
        places.append(camera.unproject([[x + 0.5, y + 0.5]], float(np.clip(toward, -deep, deep)))[0])
        radii.append(1.2 * r)
        pixels.append(np.array([x + 0.5, y + 0.5]))
        cv2.circle(open_, (int(x), int(y)), round(r * scale), 0, -1)
    return np.array(places).reshape(-1, 3), np.array(radii)


def fill_cells(
    centre: NDArray[np.float64], radius: NDArray[np.float64], flat: float, axes: NDArray[np.float64], cell: float
) -> LeafMasses:
    """Mark the cells whose middles lie in a ball that is `flat` times as high as wide."""
    middle = centre @ axes.T
    low = (middle - radius[:, None]).min(axis=0) - cell
    count = np.ceil(((middle + radius[:, None]).max(axis=0) + cell - low) / cell).astype(int)
    filled = np.zeros(count, bool)
    for at, r in zip(middle, radius, strict=True):
        first = np.maximum(np.floor((at - r - low) / cell).astype(int), 0)
        last = np.minimum(np.ceil((at + r - low) / cell).astype(int) + 1, count)
        x, y, z = ((low[k] + (np.arange(first[k], last[k]) + 0.5) * cell - at[k]) ** 2 for k in range(3))
        inside = x[:, None, None] + (y / flat**2)[:, None] + z <= r * r
        filled[first[0] : last[0], first[1] : last[1], first[2] : last[2]] |= inside
    foremost = filled.shape[2] - filled[:, :, ::-1].argmax(axis=2)
    front = np.where(filled.any(axis=2), low[2] + foremost * cell, -np.inf)
    return LeafMasses(centre, radius, axes, low, cell, filled, front)


def _at(field: NDArray[np.float64], camera: Camera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (N,) of a field (H, W) of the photo where points (N, 3) fall; -1 outside."""
    column, row = np.floor(camera.project(points)).astype(np.int64).T
    seen = (column >= 0) & (row >= 0) & (column < field.shape[1]) & (row < field.shape[0])
    return np.where(seen, field[np.where(seen, row, 0), np.where(seen, column, 0)], -1.0)
