"""One cell of the atlas: a piece of the photo, turned upright, enlarged, cut out, with a petiole drawn to it."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from forestgen.tree.leaf_blades import PETIOLE, PETIOLE_HALF_WIDTH, row_extents
from forestgen.tree.leaf_cells import Pieces
from forestgen.tree.leaf_colours import lab_of
from forestgen.tree.leaf_shapes import FORMS, SOFT, Form, half_width, taper, veins

RIM, LIGHT = 20, 90  # percentiles of a piece's light that stand for its dark rim and its lit face
CLOSE_IN = 0.25  # how far from rim (0) to face (1) a cut leaf's edge lies
LEAST_FULL = 0.32  # a cut that fills less of its cell is no leaf; leaves fill 0.4 to 0.7
LEAST_LONG = 0.7  # nor one that is shorter than this share of it
NARROWEST, WIDEST = 0.36, 0.85  # width of a blade over its length
SMOOTH_PX = 1.3  # px of the photo: sigma along a cut outline; finer teeth are the photo's pixels, not the leaf's
SMOOTHEST = 0.03  # and at least this share of the blade
MODEL = 0.42  # how far a cut outline is drawn towards an ovate leaf's: 0 as cut, 1 ovate
CALM = 0.65  # how much of a piece's own contrast a leaf keeps: the rest is gaps and light between several leaves
SWAY = 0.4  # how much of the cut's sideways sway is kept
PETIOLE_SHADE = 0.8  # how bright a petiole is beside its blade


def cut_cell(pieces: Pieces, piece: int, lab: NDArray[np.float64], height: int) -> NDArray[np.uint8] | None:
    """An RGBA cell (height, W, 4): a piece cut out along its own edge, its mean colour set to `lab` (3,) CIELAB.

    None where the piece has not the shape of a leaf.
    """
    rgb, own, opaque = upright(pieces, piece, height)
    alpha = cut(lab_of(rgb)[..., 0], own, opaque, float(pieces.length[piece]))
    if alpha is None:
        return None
    colour, alpha = fill_cell(spread_colour(rgb, np.minimum(own, opaque)), alpha)
    return finish(colour, alpha, lab, height, has_veins=True)


def generic_cell(
    pieces: Pieces, piece: int, lab: NDArray[np.float64], height: int, form: Form, *, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """An RGBA cell (height, W, 4): a drawn outline that wears the colours of a piece, with drawn veins."""
    rgb, _, opaque = upright(pieces, piece, height)
    tall, wide = opaque.shape
    alpha = FORMS[form](tall, wide, rng)
    return finish(spread_colour(rgb, opaque), alpha, lab, height, has_veins=form != "needles")


def finish(
    rgb: NDArray[np.floating], alpha: NDArray[np.float64], lab: NDArray[np.float64], height: int, *, has_veins: bool
) -> NDArray[np.uint8]:
    """The cell (height, W, 4) of a blade's texture (H, W, 3) and alpha (H, W), of mean colour `lab` (3,) CIELAB."""
    mean = rgb[alpha >= 0.5].mean(axis=0)
    calm = mean + CALM * (rgb - mean)
    if has_veins:
        calm = calm * veins(*alpha.shape)[..., None]
    return add_petiole(np.dstack([set_mean(calm, alpha, lab), alpha * 255]), height)


def spread_colour(rgb: NDArray[np.uint8], is_own: NDArray[np.floating]) -> NDArray[np.float32]:
    """Colours (H, W, 3) where a mask (H, W) in [0, 1] is low replaced by a wide blur of those where it is high."""
    weight = np.clip(is_own * 2 - 1, 0, 1).astype(np.float32)
    if weight.sum() < 1:
        return rgb.astype(np.float32)
    sigma = 0.06 * len(rgb)
    total = np.dstack([rgb * weight[..., None], weight]).astype(np.float32)
    far = total.sum(axis=(0, 1)) * 1e-6
    near = cv2.GaussianBlur(total, (0, 0), sigma) + far
    return np.asarray(rgb * weight[..., None] + near[..., :3] / near[..., 3:] * (1 - weight[..., None]))


def upright(
    pieces: Pieces, piece: int, height: int
) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.float32]]:
    """The photo around a piece, its axis turned upward, enlarged to the blade's part of a cell `height` px high.

    With it two masks in [0, 1]: the piece itself, and where the photo's colour is the leaf's own.
    """
    aspect = float(np.clip(pieces.width[piece] / pieces.length[piece], NARROWEST, WIDEST))
    tall = height - round(PETIOLE * height)
    wide = 2 * round(tall * aspect / 2)
    reach = int(np.ceil(pieces.length[piece])) + 4
    x, y = (int(v) for v in pieces.centre[piece])
    left, top = max(0, x - reach), max(0, y - reach)
    part = (slice(top, y + reach + 1), slice(left, x + reach + 1))

    along = pieces.axis[piece]
    matrix = np.empty((2, 3))  # from px of the cell to px of the part
    matrix[:, 0] = np.array([-along[1], along[0]]) * pieces.length[piece] / tall
    matrix[:, 1] = -along * pieces.length[piece] / tall
    matrix[:, 2] = pieces.centre[piece] - 0.5 - [left, top] - matrix[:, :2] @ [wide / 2 - 0.5, tall / 2 - 0.5]

    def warp(image: NDArray[Any], how: int) -> NDArray[Any]:
        flags = how | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpAffine(image, matrix, (wide, tall), flags=flags, borderMode=cv2.BORDER_REPLICATE))

    rgb = warp(np.ascontiguousarray(pieces.rgb[part]), cv2.INTER_LANCZOS4)
    masks = [
        warp(cv2.GaussianBlur(mask[part].astype(np.float32), (0, 0), 0.6), cv2.INTER_CUBIC)
        for mask in (pieces.label == piece, pieces.is_opaque)
    ]
    return rgb.astype(np.uint8), *(np.clip(mask.astype(np.float32), 0, 1) for mask in masks)  # type: ignore[return-value]


def cut(
    light: NDArray[np.float32], own: NDArray[np.float32], opaque: NDArray[np.float32], length_px: float
) -> NDArray[np.float64] | None:
    """Soft alpha (H, W) of the leaf in a piece `length_px` long in the photo: the outline of its lit part.

    None if that has no leaf's shape.
    """
    tall, wide = light.shape
    is_own = own >= 0.5
    if not is_own.any():
        return None
    rim, face = np.percentile(light[is_own], [RIM, LIGHT])
    lit = cv2.GaussianBlur(light, (0, 0), 0.03 * tall) >= rim + CLOSE_IN * (face - rim)
    smooth = max(SMOOTHEST * tall, SMOOTH_PX * tall / length_px)
    return outline_alpha(lit & (own >= 0.4) & (opaque >= 0.4) & (taper(tall, wide) >= 0.5), smooth)


def fill_cell(rgb: NDArray[np.floating], alpha: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Crop a leaf (H, W) to its outline and enlarge it to the cell's height, its base in the middle."""
    tall, wide = alpha.shape
    left, right = row_extents(alpha)
    rows = np.flatnonzero(right > left)
    first, last = int(rows[0]), int(rows[-1]) + 1
    base = slice(max(first, last - max(1, tall // 12)), last)
    middle = float((left[base] + right[base]).mean() / 2)
    half = max(middle - left[rows].min(), right[rows].max() - middle) + 1.5
    scale = tall / (last - first)
    out = 2 * int(np.ceil(half * scale))
    matrix = np.array(
        [
            [1 / scale, 0, wide / 2 + middle - out / 2 / scale + (0.5 / scale - 0.5)],
            [0, 1 / scale, first + 0.5 / scale - 0.5],
        ]
    )
    flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    colour = cv2.warpAffine(rgb.astype(np.float32), matrix, (out, tall), flags=flags, borderMode=cv2.BORDER_REPLICATE)
    mask = cv2.warpAffine(alpha, matrix, (out, tall), flags=flags, borderMode=cv2.BORDER_CONSTANT)
    return np.clip(colour, 0, 255), np.clip(mask, 0, 1)


def outline_alpha(is_leaf: NDArray[np.bool_], smooth: float) -> NDArray[np.float64] | None:
    """Soft alpha (H, W) between the left and right edge of a mask's largest part, smoothed by `smooth` px.

    A leaf's edge is met once a side, so what stands out or is eaten in becomes a lobe; an ovate
    profile weighs in, because a clump's outline meanders more than a leaf's. None where the part is
    short or thin.
    """
    tall, wide = is_leaf.shape
    n, label, stats, _ = cv2.connectedComponentsWithStats(is_leaf.astype(np.uint8), connectivity=4)
    if n < 2:
        return None
    part = label == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    left, right = row_extents(part)
    rows = np.flatnonzero(right > left)
    if len(rows) < LEAST_LONG * tall or part.mean() < LEAST_FULL:
        return None
    first, last = int(rows[0]), int(rows[-1]) + 1
    half, middle = (
        gaussian_filter1d(side[first:last], smooth, mode="nearest") for side in ((right - left) / 2, (left + right) / 2)
    )
    t = 1 - (np.arange(last - first) + 0.5) / (last - first)
    profile = half_width(t, 0.42, 0.55, 0.75)
    widest = np.sum(half) / np.sum(profile)  # as much area as was cut
    half = half ** (1 - MODEL) * (widest * profile) ** MODEL
    middle = SWAY * (middle - middle.mean())
    across = np.arange(wide) + 0.5 - wide / 2
    alpha = np.zeros((tall, wide))
    alpha[first:last] = np.clip((half[:, None] - np.abs(across - middle[:, None])) / SOFT + 0.5, 0, 1)
    return alpha


def set_mean(rgb: NDArray[np.floating], alpha: NDArray[np.float64], lab: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shift a texture (H, W, 3), 0-255, so that its mean where alpha counts is the colour `lab` (3,) CIELAB."""
    target = np.clip(cv2.cvtColor(lab.astype(np.float32).reshape(1, 1, 3), cv2.COLOR_LAB2RGB).reshape(3), 0, 1) * 255
    counts = alpha >= 0.5
    out = rgb.astype(float)
    for _ in range(4):  # what is clipped is made up for by the rest
        out = np.clip(out + target - out[counts].mean(axis=0), 0, 255)
    return out


def add_petiole(blade: NDArray[np.floating], height: int) -> NDArray[np.uint8]:
    """The cell (height, W, 4) of a blade (h, W, 4): below it a thin petiole that runs into the blade's middle."""
    tall, wide = blade.shape[:2]
    cell = np.zeros((height, wide, 4))
    cell[:tall] = blade
    solid = np.flatnonzero(blade[:, wide // 2, 3] >= 127)
    counts = blade[..., 3] >= 127
    colour = PETIOLE_SHADE * blade[counts][:, :3].mean(axis=0)
    top = int(solid[-1]) - round(0.05 * height) if len(solid) else tall
    half = max(1.0, PETIOLE_HALF_WIDTH * height)
    across = np.clip(half + 0.5 - np.abs(np.arange(wide) + 0.5 - wide / 2), 0, 1)
    below = cell[top:, :, 3] < 127
    stem = np.broadcast_to(across * 255, below.shape)
    cell[top:, :, :3] = np.where((below & (stem > 0))[..., None], colour, cell[top:, :, :3])
    cell[top:, :, 3] = np.maximum(cell[top:, :, 3], stem)
    return np.round(cell).astype(np.uint8)
