"""The measures of fidelity, as plain functions on masks: reference against render.

A `height_px` is the tree's height in pixels of the picture; every tolerance is a share of it.
Masks (H, W) are bool. Where there is nothing to disagree about, a measure answers as if it agreed.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_fill_holes

from forestgen.tree.scale import disc

Mask = NDArray[np.bool_]

CLOSING = 0.02  # share of the height: gaps narrower than twice this belong to the envelope
OUTLINE = 0.01  # tolerance of boundary_f
SHIFT = 0.005  # reach of the shifts that skill forgives
BLUR = 0.02  # sigma of the colour comparison
FULL_ENOUGH = 0.1  # blurred masks below this are not compared for colour
HOLE = 0.01  # share of the envelope above which a gap counts as a hole
GRID = 24  # cells a side of the density grid


def distance_to(mask: Mask) -> NDArray[np.float32]:
    """Euclidean distance (H, W) in px from each pixel to the nearest pixel of the mask; inf where it is empty."""
    if not mask.any():
        return np.full(mask.shape, np.inf, np.float32)
    far = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(far, np.float32)


def envelope(mask: Mask, height_px: float) -> Mask:
    """The mask closed by a disc of 2 % of the height, its holes filled."""
    closing = disc(CLOSING * height_px)
    out = np.zeros_like(mask)
    part = window(mask, len(closing))
    wide = np.pad(mask[part].astype(np.uint8), len(closing))  # what the disc finds beyond the frame is empty
    closed = cv2.morphologyEx(wide, cv2.MORPH_CLOSE, closing)
    pad = len(closing)
    out[part] = binary_fill_holes(closed)[pad:-pad, pad:-pad]
    return out


def iou(a: Mask, b: Mask) -> float:
    """Shared area over joint area; 1 where both are empty."""
    union = np.count_nonzero(a | b)
    return np.count_nonzero(a & b) / union if union else 1.0


def outline(mask: Mask) -> Mask:
    """Pixels (H, W) of the mask with a side neighbour outside it; the frame's edge is no outline."""
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    return np.asarray(mask & ~(cv2.erode(mask.astype(np.uint8), cross) > 0))


def boundary_f(reference: Mask, render: Mask, height_px: float) -> float:
    """F-score of the outlines of two envelopes within 1 % of the height."""
    a, b = outline(reference), outline(render)
    if not a.any() or not b.any():
        return float(a.any() == b.any())
    tolerance = OUTLINE * height_px
    recall = float((distance_to(b)[a] <= tolerance).mean())
    precision = float((distance_to(a)[b] <= tolerance).mean())
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


def best_shifted_iou(reference: Mask, render: Mask, reach_px: int) -> float:
    """The best IoU over whole-pixel shifts of the render by up to `reach_px` along each axis.

    Rows are packed to bits, so that a shift costs an AND and a population count. What a shift
    moves out of the frame is not counted.
    """
    width = reference.shape[1]
    row = np.pad(reference, ((reach_px, reach_px), (0, -width % 64)))
    fixed = np.packbits(row, axis=1).view(np.uint64)
    height = reference.shape[0]
    n_fixed = np.count_nonzero(reference)
    best = 0.0
    for dx in range(-reach_px, reach_px + 1):
        moved = np.zeros_like(reference)
        source = slice(max(0, -dx), width - max(0, dx))
        moved[:, max(0, dx) : width - max(0, -dx)] = render[:, source]
        in_row = np.count_nonzero(moved, axis=1)
        packed = np.packbits(np.pad(moved, ((0, 0), (0, -width % 64))), axis=1).view(np.uint64)
        for dy in range(-reach_px, reach_px + 1):
            under = fixed[reach_px + dy : reach_px + dy + height]
            shared = int(np.bitwise_count(under & packed).sum(dtype=np.int64))
            n_moved = int(in_row[max(0, -dy) : height - max(0, dy)].sum())
            union = n_fixed + n_moved - shared
            best = max(best, shared / union if union else 1.0)
    return best


def skill(reference: Mask, render: Mask, reference_envelope: Mask, height_px: float) -> float:
    """Silhouette IoU above what leaves thrown at random into the envelope reach: (iou - b) / (1 - b)."""
    inside = np.count_nonzero(reference_envelope)
    f = np.count_nonzero(reference & reference_envelope) / inside if inside else 1.0
    best = best_shifted_iou(reference, render, int(np.ceil(SHIFT * height_px)))
    chance = f / (2 - f)
    return (best - chance) / (1 - chance) if chance < 1 else float(best == 1)


def gap_recall(reference: Mask, render: Mask, reference_envelope: Mask) -> float:
    """Of the reference's holes, each above 1 % of the envelope, the share of area the render leaves open.

    A hole's pixels hang together over their sides, not over corners.
    """
    _, label, stats, _ = cv2.connectedComponentsWithStats(
        (reference_envelope & ~reference).astype(np.uint8), connectivity=4
    )
    large = stats[:, cv2.CC_STAT_AREA] > HOLE * np.count_nonzero(reference_envelope)
    large[0] = False
    hole = large[label]
    total = np.count_nonzero(hole)
    return np.count_nonzero(hole & ~render) / total if total else 1.0


def grid_coverage(mask: Mask, box: tuple[float, float, float, float]) -> NDArray[np.float64]:
    """Covered share (24, 24) of the cells of a box (left, top, right, bottom) px; cells may cut pixels."""
    left, top, right, bottom = box

    def overlap(start: float, end: float, length: int) -> NDArray[np.float64]:
        edge = np.linspace(start, end, GRID + 1)
        pixel = np.arange(length)
        share = np.minimum(edge[1:, None], pixel + 1) - np.maximum(edge[:-1, None], pixel)
        return np.asarray(np.maximum(share, 0) / (edge[1] - edge[0]), np.float64)

    down, across = overlap(top, bottom, mask.shape[0]), overlap(left, right, mask.shape[1])
    return np.asarray(down @ mask @ across.T)


def density_correlation(reference: Mask, render: Mask, box: tuple[float, float, float, float]) -> float:
    """Pearson's r of the coverage of the 24 x 24 cells of the crown's box.

    Where one of the two is the same in all cells r is undefined: 1 if they are equal, else 0.
    """
    a, b = grid_coverage(reference, box).ravel(), grid_coverage(render, box).ravel()
    if np.ptp(a) < 1e-12 or np.ptp(b) < 1e-12:
        return float(np.allclose(a, b))
    return float(np.corrcoef(a, b)[0, 1])


def colour_delta_e(
    photo: NDArray[np.float32],
    reference: Mask,
    colour: NDArray[np.float32],
    render: Mask,
    reference_envelope: Mask,
    height_px: float,
) -> float:
    """Mean CIEDE2000 between two pictures (H, W, 3; sRGB-encoded, [0, 1]), each averaged over its own mask.

    Pictures times masks, blurred with sigma 2 % of the height, over the equally blurred masks;
    compared inside the envelope where both blurred masks exceed 0.1. 100 where nowhere both do.
    """
    from skimage.color import deltaE_ciede2000, rgb2lab

    sigma = BLUR * height_px
    part = window(reference | render | reference_envelope, int(np.ceil(4 * sigma)))
    cell = max(1, int(sigma / 5))
    mean_a, share_a = masked_blur(photo[part], reference[part], sigma, cell)
    mean_b, share_b = masked_blur(colour[part], render[part], sigma, cell)
    weight = shrink(reference_envelope[part].astype(np.float32), cell)
    where = (weight > 0) & (share_a > FULL_ENOUGH) & (share_b > FULL_ENOUGH)
    if not where.any():
        return 100.0
    lab = [rgb2lab(np.clip(mean[where], 0, 1)) for mean in (mean_a, mean_b)]
    difference = deltaE_ciede2000(*lab)  # type: ignore[no-untyped-call]
    return float(np.average(difference, weights=weight[where]))


def shrink(image: NDArray[np.float32], cell: int) -> NDArray[np.float32]:
    """Means (H / cell, W / cell, ...) of the image's square cells; beyond its edge it is 0."""
    room = [(0, -length % cell) for length in image.shape[:2]] + [(0, 0)] * (image.ndim - 2)
    padded = np.pad(image, room)
    size = (padded.shape[1] // cell, padded.shape[0] // cell)
    return np.asarray(cv2.resize(padded, size, interpolation=cv2.INTER_AREA), np.float32)


def masked_blur(
    picture: NDArray[np.float32], mask: Mask, sigma: float, cell: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The picture (H, W, 3) averaged over its mask by a Gaussian, and the blurred mask, per cell of pixels.

    Cells of a fifth of sigma change the colour difference by less than 0.3 % (see the tests) and
    save nearly all of the work; the blur that averaging a cell brings is taken off sigma.
    """
    share = mask.astype(np.float32)
    layers = shrink(np.dstack([picture * share[..., None], share]), cell)
    rest = float(np.sqrt(sigma**2 - (cell**2 - 1) / 12) / cell)
    blurred = np.asarray(cv2.GaussianBlur(layers, (0, 0), rest, borderType=cv2.BORDER_CONSTANT), np.float32)
    weight = blurred[..., 3]
    return np.asarray(blurred[..., :3] / np.maximum(weight, 1e-6)[..., None], np.float32), weight


def window(mask: Mask, margin: int) -> tuple[slice, slice]:
    """Rows and columns that hold the mask and a margin; the whole picture where it is empty."""
    if not mask.any():
        return slice(None), slice(None)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (
        slice(max(0, int(rows[0]) - margin), int(rows[-1]) + margin + 1),
        slice(max(0, int(columns[0]) - margin), int(columns[-1]) + margin + 1),
    )


def points_along(xy: NDArray[np.float64], parent: NDArray[np.int64]) -> NDArray[np.float64]:
    """Points (M, 2) about a pixel apart along the edges of a rooted graph (N, 2), each edge alike."""
    start, end = xy[parent[1:]], xy[1:]
    n = np.maximum(1, np.ceil(np.linalg.norm(end - start, axis=1))).astype(int)
    edge = np.repeat(np.arange(len(n)), n)
    step = np.arange(len(edge)) - np.repeat(np.cumsum(n) - n, n)
    t = (step + 0.5) / n[edge]
    return np.asarray(start[edge] + (end - start)[edge] * t[:, None])


def branch_chamfer(
    traced: NDArray[np.float64],
    foliage: Mask,
    wood: Mask,
    leaf: Mask,
    height_px: float,
) -> float:
    """Mean distance, both ways, of traced points (M, 2) px and thinned visible wood, over the height.

    `foliage` is the photo's, `wood` and `leaf` are what is in front in the render. A traced point
    behind a leaf of the render, and wood drawn where the photo shows foliage, could not be seen in
    the other picture and do not count; neither do traced points outside the frame. The mean is that
    of the two ways' means; a way without a point that counts says nothing. Traced points that
    could be seen and no visible wood at all: 1.
    """
    from scipy.spatial import cKDTree

    height, width = wood.shape
    column, row = np.floor(traced).astype(int).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    traced, column, row = traced[inside], column[inside], row[inside]
    drawn = thinned(wood)
    rows, columns = np.nonzero(drawn)
    drawn_xy = np.column_stack([columns, rows]) + 0.5
    shows = ~leaf[row, column]
    counts = ~foliage[rows, columns]
    ways = []
    if shows.any():
        ways.append(cKDTree(drawn_xy).query(traced[shows])[0].mean() if len(drawn_xy) else height_px)
    if counts.any():
        ways.append(cKDTree(traced).query(drawn_xy[counts])[0].mean() if len(traced) else height_px)
    return min(1.0, float(np.mean(ways)) / height_px) if ways else 0.0


def thinned(mask: Mask) -> Mask:
    """The mask's middle lines (H, W), one pixel wide."""
    rows, columns = window(mask, 1)
    out = np.zeros_like(mask)
    if mask.any():
        thin = cv2.ximgproc.thinning(np.ascontiguousarray(mask[rows, columns]).astype(np.uint8) * 255)
        out[rows, columns] = thin > 0
    return out
