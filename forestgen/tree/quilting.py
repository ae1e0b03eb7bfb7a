"""Quilting: a texture that tiles both ways, sewn from patches of a sample (Efros & Freeman 2001)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

N_CANDIDATES = 64  # places of the sample tried for each patch
CHOICE = 1.1  # any place whose mismatch is within this factor of the best may be taken (their "error tolerance")
ORDINARY = 0.4  # share of the places, the least odd ones, that patches are taken from
WORN = 0.6  # extra mismatch for each time a place's surroundings were taken already: keeps repetition away


def quilt(
    sample: NDArray[np.float32],
    is_valid: NDArray[np.bool_],
    blocks: tuple[int, int],
    patch: int,
    overlap: int,
    *,
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Sew a tile of `blocks` (rows, columns) patches, each `patch` px, overlapping by `overlap` px.

    The canvas is a torus, so the tile (rows * step, columns * step, 3), step = patch - overlap, has
    no edge. Patches are taken where the sample (H, W, 3) is valid (H, W); the cut through each
    overlap is the path of least difference.

    Raises:
        ValueError: the sample has no place for a whole valid patch, or the blocks are too few.
    """
    places = valid_places(is_valid, patch)
    places = places[is_ordinary(sample, places, patch)]
    if not len(places) or min(blocks) < 2 or not 0 < 2 * overlap <= patch:
        raise ValueError(f"quilt: {len(places)} places for a patch of {patch} px, overlap {overlap}, {blocks} blocks")
    step = patch - overlap
    tile = np.zeros((blocks[0] * step, blocks[1] * step, 3), np.float32)
    is_sewn = np.zeros(tile.shape[:2], bool)
    worn = np.zeros(len(places))
    for row in range(blocks[0]):
        for column in range(blocks[1]):
            at = np.ix_((row * step + np.arange(patch)) % len(tile), (column * step + np.arange(patch)) % tile.shape[1])
            old, known = tile[at], is_sewn[at]
            tried = rng.choice(len(places), min(N_CANDIDATES, len(places)), replace=False)
            pieces = np.stack([sample[y : y + patch, x : x + patch] for y, x in places[tried]])
            mismatch = np.sum((pieces - old) ** 2 * known[None, :, :, None], axis=(1, 2, 3))
            mismatch = (mismatch / max(int(known.sum()), 1) + 1e-5) * (1 + WORN * worn[tried])
            taken = int(rng.choice(np.flatnonzero(mismatch <= CHOICE * mismatch.min())))
            worn += np.exp(-2 * np.sum((places - places[tried[taken]]) ** 2, axis=1) / patch**2)
            sides = (column > 0, row > 0, column == blocks[1] - 1, row == blocks[0] - 1)
            keep_new = sewn_mask(np.sum((pieces[taken] - old) ** 2, axis=2), known, overlap, sides)[:, :, None]
            tile[at] = keep_new * pieces[taken] + (1 - keep_new) * old
            is_sewn[at] = True
    return tile


def valid_places(is_valid: NDArray[np.bool_], patch: int) -> NDArray[np.int64]:
    """Top-left corners (N, 2) row, column of all patches that hold no invalid pixel."""
    if min(is_valid.shape) < patch:
        return np.zeros((0, 2), np.int64)
    holes = cv2.integral((~is_valid).astype(np.uint8))
    count = holes[patch:, patch:] - holes[:-patch, patch:] - holes[patch:, :-patch] + holes[:-patch, :-patch]
    return np.argwhere(count == 0)


def is_ordinary(sample: NDArray[np.float32], places: NDArray[np.int64], patch: int) -> NDArray[np.bool_]:
    """Whether the patch at each place (N,) looks like most of the sample (H, W, 3).

    A knot, a fork or the edge of a shadow is worth seeing once; in a tile it comes back as a grid.
    Those are kept whose coarse colour and whose local contrast are nearest to the median's.
    """
    if not len(places):
        return np.zeros(0, bool)
    coarse = cv2.GaussianBlur(sample, (0, 0), max(1.0, patch / 8))
    hue = np.sum((coarse - np.median(sample, axis=(0, 1))) ** 2, axis=2)
    contrast = np.sqrt(cv2.GaussianBlur(np.sum((sample - coarse) ** 2, axis=2), (0, 0), max(1.0, patch / 4)))
    depth = (contrast - np.median(contrast)) ** 2
    odd = (hue / max(float(hue.mean()), 1e-9) + depth / max(float(depth.mean()), 1e-9)) ** 1.5
    total = cv2.integral(odd.astype(np.float64))
    y, x = places.T
    oddness = total[y + patch, x + patch] - total[y, x + patch] - total[y + patch, x] + total[y, x]
    return np.asarray(oddness <= np.quantile(oddness, ORDINARY))


def sewn_mask(
    difference: NDArray[np.float32],
    known: NDArray[np.bool_],
    overlap: int,
    sides: tuple[bool, bool, bool, bool],
) -> NDArray[np.float32]:
    """Share (P, P) of the new patch, given its squared difference (P, P) from what is sewn already.

    `sides` tells on which of left, top, right, bottom it overlaps its neighbours.
    """
    new = np.ones(difference.shape, np.float32)
    for is_open, quarter in zip(sides, (0, 1, 2, 3), strict=True):
        if not is_open:
            continue
        turned = np.rot90(difference, quarter)  # brings the side in question to the left
        cut = least_path(turned[:, :overlap])
        keeps = np.ones_like(turned)
        keeps[:, :overlap] = np.arange(overlap)[None, :] >= cut[:, None]
        new = np.minimum(new, np.rot90(keeps, -quarter))
    soft = cv2.blur(new, (3, 3), borderType=cv2.BORDER_REPLICATE)
    return np.where(known, soft, 1).astype(np.float32)


def least_path(cost: NDArray[np.float32]) -> NDArray[np.int64]:
    """Column (H,) in each row of the cheapest path from top to bottom of a cost (H, W)."""
    total = cost.astype(np.float64)
    for row in range(1, len(total)):
        above = np.pad(total[row - 1], 1, constant_values=np.inf)
        total[row] += np.minimum(np.minimum(above[:-2], above[1:-1]), above[2:])
    path = np.empty(len(total), np.int64)
    path[-1] = np.argmin(total[-1])
    for row in range(len(total) - 2, -1, -1):
        low = max(path[row + 1] - 1, 0)
        path[row] = low + np.argmin(total[row, low : path[row + 1] + 2])
    return path


def blur_torus(image: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """Gaussian blur of an image (H, W, 3) that tiles."""
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(image, (sigma, sigma, 0), mode="wrap"), np.float32)


def enlarge(tile: NDArray[np.float32], size: tuple[int, int], gain: float) -> NDArray[np.float32]:
    """A tile (H, W, 3) at a larger `size` (height, width), with detail that it does not show.

    Bark looks alike at neighbouring scales, so each octave beyond the sample's sharpness is
    filled with the finest of the tile itself, at half its scale, `gain` times as strong.
    """
    large = resize_torus(tile, size)
    scale = size[1] / tile.shape[1]
    for octave in range(1, int(np.log2(max(scale, 1)) + 0.25) + 1):
        n = 2**octave
        small = resize_torus(tile, (size[0] // n, size[1] // n))
        fine = np.tile(small, (n, n, 1))
        fine = np.roll(fine, (size[0] // 3, size[1] // 5), axis=(0, 1))
        large = large + gain**octave * (fine - blur_torus(fine, 0.7 * scale / 2 ** (octave - 1)))
    return np.asarray(large, np.float32)


def resize_torus(tile: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    """Resize an image (H, W, 3) that tiles to (height, width), still tiling."""
    height, width = tile.shape[:2]
    border = 8
    padded = np.pad(tile, ((border, border), (border, border), (0, 0)), mode="wrap")
    rows = ((np.arange(size[0]) + 0.5) * height / size[0] - 0.5 + border).astype(np.float32)
    columns = ((np.arange(size[1]) + 0.5) * width / size[1] - 0.5 + border).astype(np.float32)
    if size[1] < width:
        padded = np.asarray(cv2.GaussianBlur(padded, (0, 0), 0.4 * width / size[1]), np.float32)
    x, y = np.meshgrid(columns, rows)
    return np.asarray(cv2.remap(padded, x, y, cv2.INTER_CUBIC), np.float32)
